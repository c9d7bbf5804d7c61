/* The WebGL2 side: one canvas under both panels, one set of buffers for both. */

const MODES = { checker: 0, distortion: 1, charts: 2, texture: 3, picking: 4, density: 5, faults: 6, twice: 7 };

function program(gl, vertex, fragment) {
  const out = gl.createProgram();
  for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    gl.attachShader(out, shader);
  }
  gl.linkProgram(out);
  if (!gl.getProgramParameter(out, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(out));
  const at = {};
  const n = gl.getProgramParameter(out, gl.ACTIVE_UNIFORMS);
  for (let i = 0; i < n; i++) {
    const name = gl.getActiveUniform(out, i).name.replace("[0]", "");
    at[name] = gl.getUniformLocation(out, name);
  }
  return { program: out, at };
}

/* Faces without shared corners, so that a face can hold its own chart and distortion: 20 bytes a corner. */
function cornerBuffer(mesh) {
  const { index, position, uv, normal, chart, distortion, density } = mesh;
  const bytes = new ArrayBuffer(index.length * 20);
  const words = new Uint16Array(bytes), small = new Uint8Array(bytes), long = new Uint32Array(bytes);
  for (let c = 0; c < index.length; c++) {
    const v = index[c], w = c * 10;
    words[w] = position[3 * v];
    words[w + 1] = position[3 * v + 1];
    words[w + 2] = position[3 * v + 2];
    words[w + 3] = distortion[(c / 3) | 0] | (density[(c / 3) | 0] << 8);
    words[w + 4] = uv[2 * v];
    words[w + 5] = uv[2 * v + 1];
    small[2 * w + 12] = normal[2 * v];
    small[2 * w + 13] = normal[2 * v + 1];
    long[c * 5 + 4] = chart[(c / 3) | 0];
  }
  return bytes;
}

/* One record of 24 bytes for each border half-edge of a chart. */
function seamBuffer(mesh) {
  const { index, position, uv, chart, seams } = mesh;
  const bytes = new ArrayBuffer(seams.length * 24);
  const words = new Uint16Array(bytes), long = new Uint32Array(bytes);
  for (let s = 0; s < seams.length; s++) {
    const h = seams[s], a = index[h], b = index[h % 3 === 2 ? h - 2 : h + 1], w = s * 12;
    for (let k = 0; k < 3; k++) {
      words[w + k] = position[3 * a + k];
      words[w + 3 + k] = position[3 * b + k];
    }
    for (let k = 0; k < 2; k++) {
      words[w + 6 + k] = uv[2 * a + k];
      words[w + 8 + k] = uv[2 * b + k];
    }
    long[s * 6 + 5] = chart[(h / 3) | 0];
  }
  return bytes;
}

class Renderer {
  constructor(canvas, meta, mesh) {
    const gl = canvas.getContext("webgl2", { antialias: true, alpha: false, stencil: true });
    if (!gl) throw new Error("this browser offers no WebGL2");
    this.gl = gl;
    this.canvas = canvas;
    this.meta = meta;
    this.fill = program(gl, FILL_VERTEX, FILL_FRAGMENT);
    this.line = program(gl, LINE_VERTEX, LINE_FRAGMENT);
    this.ground = program(gl, GROUND_VERTEX, GROUND_FRAGMENT);
    this.corners = mesh.index.length;
    this.seams = mesh.seams.length;
    this.buffers = [];
    this.faces = this.vertexArray(cornerBuffer(mesh), 20, 0, [
      [3, gl.UNSIGNED_SHORT, 0], [2, gl.UNSIGNED_SHORT, 8], [2, gl.UNSIGNED_BYTE, 12],
      [1, gl.UNSIGNED_INT, 16], [1, gl.UNSIGNED_SHORT, 6],
    ], 3);
    this.edges = this.vertexArray(seamBuffer(mesh), 24, 1, [
      [3, gl.UNSIGNED_SHORT, 0], [3, gl.UNSIGNED_SHORT, 6], [2, gl.UNSIGNED_SHORT, 12],
      [2, gl.UNSIGNED_SHORT, 16], [1, gl.UNSIGNED_INT, 20],
    ], 4);
    this.empty = gl.createVertexArray();
    this.ramp = this.texture(gl.CLAMP_TO_EDGE, false);
    const ramp = new Uint8Array(meta.ramp.flatMap((code) => this.bytes(code)));
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGB, meta.ramp.length, 1, 0, gl.RGB, gl.UNSIGNED_BYTE, ramp);
    this.images = [];
    this.pick = { framebuffer: gl.createFramebuffer(), colour: gl.createTexture(), depth: gl.createRenderbuffer() };
    this.setConstants();
  }

  bytes(code) {
    return [1, 3, 5].map((i) => parseInt(code.slice(i, i + 2), 16));
  }

  colour(code) {
    return this.bytes(code).map((c) => c / 255);
  }

  /* Attributes from `whole` on are integers; the others are scaled to 0..1. */
  vertexArray(bytes, stride, divisor, attributes, whole) {
    const gl = this.gl, array = gl.createVertexArray();
    gl.bindVertexArray(array);
    this.buffers.push(gl.createBuffer());
    gl.bindBuffer(gl.ARRAY_BUFFER, this.buffers.at(-1));
    gl.bufferData(gl.ARRAY_BUFFER, bytes, gl.STATIC_DRAW);
    attributes.forEach(([size, type, offset], i) => {
      gl.enableVertexAttribArray(i);
      if (i < whole) gl.vertexAttribPointer(i, size, type, true, stride, offset);
      else gl.vertexAttribIPointer(i, size, type, stride, offset);
      gl.vertexAttribDivisor(i, divisor);
    });
    gl.bindVertexArray(null);
    return array;
  }

  /* The same faces with other positions and normals. */
  setGeometry(mesh) {
    const gl = this.gl;
    [cornerBuffer(mesh), seamBuffer(mesh)].forEach((bytes, k) => {
      gl.bindBuffer(gl.ARRAY_BUFFER, this.buffers[k]);
      gl.bufferData(gl.ARRAY_BUFFER, bytes, gl.DYNAMIC_DRAW);
    });
  }

  texture(wrap, mipmaps) {
    const gl = this.gl, out = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, out);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, wrap);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_T, wrap);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, mipmaps ? gl.LINEAR_MIPMAP_LINEAR : gl.LINEAR);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.LINEAR);
    return out;
  }

  setConstants() {
    const gl = this.gl, { meta } = this, u = this.fill.at;
    gl.useProgram(this.fill.program);
    gl.uniform3fv(u.palette, meta.palette.flatMap((c) => this.colour(c)));
    gl.uniform3fv(u.flipColour, this.colour(meta.flip));
    gl.uniform3fv(u.warnColour, this.colour(meta.twice));
    gl.uniform3fv(u.emptyColour, this.colour(meta.noUv));
    gl.uniform3fv(u.extent, meta.extent);
    gl.uniform4fv(u.uvBox, meta.uvBox);
    gl.uniform1i(u.insideOut, meta.insideOut ? 1 : 0);
    gl.uniform1i(u.ramp, 0);
    gl.uniform1i(u.image, 1);
    gl.useProgram(this.ground.program);
    gl.uniform4fv(this.ground.at.uvBox, meta.uvBox);
  }

  /* Take the colours of a scheme, light or dark: those of the ground, and what other charts fade to. */
  setScheme(colours) {
    const gl = this.gl;
    this.paper = this.colour(colours.paper);
    gl.useProgram(this.ground.program);
    gl.uniform3fv(this.ground.at.panel, this.colour(colours.panel));
    gl.uniform3fv(this.ground.at.hairline, this.colour(colours.hairline));
    gl.useProgram(this.fill.program);
    gl.uniform3fv(this.fill.at.faded, this.colour(colours.panel));
  }

  addImage(slot, element, flip = true) {
    const gl = this.gl;
    this.images[slot] = this.texture(gl.REPEAT, true);
    gl.pixelStorei(gl.UNPACK_FLIP_Y_WEBGL, flip);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, gl.RGBA, gl.UNSIGNED_BYTE, element);
    gl.pixelStorei(gl.UNPACK_FLIP_Y_WEBGL, false);
    gl.generateMipmap(gl.TEXTURE_2D);
  }

  /* Draw the panels: [{x, y, width, height, matrix, turn, plane}], in pixels from the bottom left. */
  draw(panels, state) {
    const gl = this.gl, [r, g, b] = this.paper;
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.disable(gl.SCISSOR_TEST);
    gl.clearColor(r, g, b, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    for (const panel of panels) {
      this.enter(panel);
      if (panel.plane) this.drawGround(panel);
      this.drawFaces(panel, state, MODES[state.mode]);
      if (panel.plane && state.mode === "faults") this.drawTwice(panel, state);
      if (state.seams || state.hovered >= 0) this.drawSeams(panel, state);
    }
  }

  enter(panel) {
    const gl = this.gl;
    gl.enable(gl.SCISSOR_TEST);
    gl.viewport(panel.x, panel.y, panel.width, panel.height);
    gl.scissor(panel.x, panel.y, panel.width, panel.height);
  }

  drawGround(panel) {
    const gl = this.gl, { bounds, uvBox } = this.meta;
    gl.disable(gl.DEPTH_TEST);
    gl.useProgram(this.ground.program);
    gl.uniformMatrix4fv(this.ground.at.matrix, false, panel.matrix);
    const box = bounds.map((c, i) => (c - uvBox[i % 2]) / uvBox[2 + (i % 2)]);
    gl.uniform4fv(this.ground.at.box, box);
    gl.bindVertexArray(this.empty);
    gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
  }

  drawFaces(panel, state, mode) {
    const gl = this.gl, u = this.fill.at;
    gl.useProgram(this.fill.program);
    gl.uniformMatrix4fv(u.matrix, false, panel.matrix);
    gl.uniformMatrix3fv(u.turn, false, panel.turn);
    gl.uniform1i(u.plane, panel.plane ? 1 : 0);
    gl.uniform1i(u.hovered, state.hovered);
    gl.uniform1i(u.mode, mode);
    gl.uniform1i(u.wire, state.wire && mode !== MODES.picking && mode !== MODES.twice ? 1 : 0);
    gl.uniform1f(u.cells, state.cells);
    gl.uniform1f(u.distortionEnd, Math.log(state.distortionEnd));
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, this.ramp);
    gl.activeTexture(gl.TEXTURE1);
    gl.bindTexture(gl.TEXTURE_2D, this.ramp);
    if (panel.plane) gl.disable(gl.DEPTH_TEST);
    else gl.enable(gl.DEPTH_TEST);
    gl.bindVertexArray(this.faces);
    const ranges = mode === MODES.texture && !this.own ? this.meta.ranges : [{ image: -1, first: 0, count: this.corners / 3 }];
    for (const { image, first, count } of ranges) {
      const texture = mode === MODES.texture && this.own ? this.own : this.images[image];
      gl.uniform1i(u.hasImage, texture ? 1 : 0);
      if (texture) gl.bindTexture(gl.TEXTURE_2D, texture);
      gl.drawArrays(gl.TRIANGLES, 3 * first, 3 * count);
    }
  }

  /* What more than one face covers: each counts itself in the stencil, and from two on it is lit. */
  drawTwice(panel, state) {
    const gl = this.gl;
    gl.enable(gl.STENCIL_TEST);
    gl.clear(gl.STENCIL_BUFFER_BIT);
    gl.colorMask(false, false, false, false);
    gl.stencilFunc(gl.ALWAYS, 0, 255);
    gl.stencilOp(gl.INCR, gl.INCR, gl.INCR);
    this.drawFaces(panel, state, MODES.twice);
    gl.colorMask(true, true, true, true);
    gl.stencilFunc(gl.LESS, 1, 255);
    gl.stencilOp(gl.KEEP, gl.KEEP, gl.KEEP);
    this.drawFaces(panel, state, MODES.twice);
    gl.disable(gl.STENCIL_TEST);
  }

  /* An image of the user in place of all textures. */
  setOwnImage(bitmap) {
    this.addImage(0, bitmap, false);
    this.own = this.images[0];
  }

  drawSeams(panel, state) {
    const gl = this.gl, u = this.line.at;
    gl.useProgram(this.line.program);
    gl.uniformMatrix4fv(u.matrix, false, panel.matrix);
    gl.uniform1i(u.plane, panel.plane ? 1 : 0);
    gl.uniform1i(u.hovered, state.hovered);
    gl.uniform2f(u.pixels, panel.width, panel.height);
    // thinner where there are many, until they are zoomed apart
    const weight = clamp(this.meta.lines[panel.plane ? "plane" : "surface"] * Math.sqrt(panel.zoom), 0.2, 1);
    gl.uniform1f(u.thickness, (panel.plane ? 1.2 : 1.5) * weight * state.ratio);
    const [r, g, b] = this.colour(this.meta.schemes.light.ink); // charts are pale in both schemes
    const ink = (state.mode === "distortion" && !panel.plane ? 0.55 : 0.9) * Math.sqrt(weight);
    gl.uniform4f(u.ink, r, g, b, ink);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    gl.depthMask(false);
    gl.bindVertexArray(this.edges);
    gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, this.seams);
    gl.depthMask(true);
    gl.disable(gl.BLEND);
  }

  /* Render the chart numbers of all panels, to be read by chartAt. scale: canvas pixels → these pixels. */
  drawPicking(panels, state) {
    const gl = this.gl, { framebuffer, colour, depth } = this.pick;
    const scale = 1 / state.ratio;
    this.pick.height = Math.ceil(this.canvas.height * scale);
    const width = Math.ceil(this.canvas.width * scale);
    gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
    gl.activeTexture(gl.TEXTURE2);
    gl.bindTexture(gl.TEXTURE_2D, colour);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, width, this.pick.height, 0, gl.RGBA, gl.UNSIGNED_BYTE, null);
    gl.bindRenderbuffer(gl.RENDERBUFFER, depth);
    gl.renderbufferStorage(gl.RENDERBUFFER, gl.DEPTH_COMPONENT24, width, this.pick.height);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, colour, 0);
    gl.framebufferRenderbuffer(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.RENDERBUFFER, depth);
    gl.disable(gl.SCISSOR_TEST);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    for (const panel of panels) {
      const small = Object.fromEntries(["x", "y", "width", "height"].map((k) => [k, Math.round(panel[k] * scale)]));
      this.enter({ ...panel, ...small });
      this.drawFaces(panel, state, MODES.picking);
    }
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  }

  /* The chart at a place of the canvas, in page pixels from its top left; −1 for none. */
  chartAt(x, y) {
    const gl = this.gl, pixel = new Uint8Array(4);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.pick.framebuffer);
    gl.readPixels(Math.floor(x), this.pick.height - 1 - Math.floor(y), 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    return pixel[3] ? pixel[0] + 256 * pixel[1] + 65536 * pixel[2] - 1 : -1;
  }
}
