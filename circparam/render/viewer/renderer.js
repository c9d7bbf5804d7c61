/* The WebGL2 side: one canvas under both panels, one set of buffers for both. */

/* Those from picking on are for the page itself. */
const MODES = { checker: 0, distortion: 1, charts: 2, texture: 3, density: 4, faults: 5, picking: 6, twice: 7, count: 8 };

/* Start to compile; the browser does so beside what follows. */
function compiled(gl, vertex, fragment) {
  const out = gl.createProgram();
  for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    gl.attachShader(out, shader);
  }
  gl.linkProgram(out);
  return out;
}

/* A program that is ready, with the places of its uniforms. */
function linked(gl, out) {
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
  const { index, position, uv, normal, chart, distortion, density, copied } = mesh;
  const bytes = new ArrayBuffer(index.length * 20);
  const words = new Uint16Array(bytes), long = new Uint32Array(bytes);
  for (let f = 0, c = 0, w = 0; f < chart.length; f++) {
    const codes = distortion[f] | (density[f] << 8), own = chart[f], again = copied[f] << 16;
    for (let k = 0; k < 3; k++, c++, w += 10) {
      const v = index[c];
      words[w] = position[3 * v];
      words[w + 1] = position[3 * v + 1];
      words[w + 2] = position[3 * v + 2];
      words[w + 3] = codes;
      words[w + 4] = uv[2 * v];
      words[w + 5] = uv[2 * v + 1];
      long[w / 2 + 3] = normal[2 * v] | (normal[2 * v + 1] << 8) | again;
      long[w / 2 + 4] = own;
    }
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

const COUNTED = 2048; // texels a side of the picture that says how many faces cover a place of the layout

/* A layout as the graphics card has it: its buffers, its images, and `covered`, made when faults are looked at. */
class Layer {
  constructor(renderer, meta, mesh) {
    const gl = renderer.gl;
    this.gl = gl;
    this.meta = meta;
    this.corners = mesh.index.length;
    this.seams = mesh.seams.length;
    this.buffers = [];
    this.images = [];
    this.faces = this.vertexArray(cornerBuffer(mesh), 20, 0, [
      [3, gl.UNSIGNED_SHORT, 0], [2, gl.UNSIGNED_SHORT, 8], [2, gl.UNSIGNED_BYTE, 12],
      [1, gl.UNSIGNED_INT, 16], [1, gl.UNSIGNED_SHORT, 6], [1, gl.UNSIGNED_BYTE, 14],
    ], 3);
    this.edges = this.vertexArray(seamBuffer(mesh), 24, 1, [
      [3, gl.UNSIGNED_SHORT, 0], [3, gl.UNSIGNED_SHORT, 6], [2, gl.UNSIGNED_SHORT, 12],
      [2, gl.UNSIGNED_SHORT, 16], [1, gl.UNSIGNED_INT, 20],
    ], 4);
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
}

/* One canvas under all panels; the shaders are compiled while the page reads its data. */
class Renderer {
  constructor(canvas, common) {
    const gl = canvas.getContext("webgl2", { antialias: true, alpha: false, stencil: true });
    if (!gl) throw new Error("this browser offers no WebGL2");
    this.gl = gl;
    this.canvas = canvas;
    this.common = common;
    this.programs = [[FILL_VERTEX, FILL_FRAGMENT], [LINE_VERTEX, LINE_FRAGMENT], [GROUND_VERTEX, GROUND_FRAGMENT]]
      .map(([vertex, fragment]) => compiled(gl, vertex, fragment));
  }

  /* Wait for the shaders, and set what never changes. */
  finish() {
    const gl = this.gl;
    [this.fill, this.line, this.ground] = this.programs.map((each) => linked(gl, each));
    this.empty = gl.createVertexArray();
    this.ramp = this.texture(gl.CLAMP_TO_EDGE, false);
    const ramp = new Uint8Array(this.common.ramp.flatMap((code) => this.bytes(code)));
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGB, this.common.ramp.length, 1, 0, gl.RGB, gl.UNSIGNED_BYTE, ramp);
    this.pick = { framebuffer: gl.createFramebuffer(), colour: gl.createTexture(), depth: gl.createRenderbuffer() };
    this.setConstants();
  }

  bytes(code) {
    return [1, 3, 5].map((i) => parseInt(code.slice(i, i + 2), 16));
  }

  colour(code) {
    return this.bytes(code).map((c) => c / 255);
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
    const gl = this.gl, { common } = this, u = this.fill.at;
    gl.useProgram(this.fill.program);
    gl.uniform3fv(u.palette, common.palette.flatMap((c) => this.colour(c)));
    gl.uniform3fv(u.flipColour, this.colour(common.flip));
    gl.uniform3fv(u.warnColour, this.colour(common.twice));
    gl.uniform3fv(u.emptyColour, this.colour(common.noUv));
    gl.uniform1i(u.ramp, 0);
    gl.uniform1i(u.image, 1);
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

  /* A texture of an image. */
  imageTexture(element, flip = true) {
    const gl = this.gl, out = this.texture(gl.REPEAT, true);
    gl.pixelStorei(gl.UNPACK_FLIP_Y_WEBGL, flip);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, gl.RGBA, gl.UNSIGNED_BYTE, element);
    gl.pixelStorei(gl.UNPACK_FLIP_Y_WEBGL, false);
    gl.generateMipmap(gl.TEXTURE_2D);
    return out;
  }

  /* Draw the panels: [{x, y, width, height, matrix, turn, plane, layer, hovered}], in pixels from the bottom left. */
  draw(panels, state) {
    const gl = this.gl, [r, g, b] = this.paper;
    if (state.mode === "faults") panels.forEach(({ layer }) => (layer.covered ??= this.count(layer)));
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.disable(gl.SCISSOR_TEST);
    gl.clearColor(r, g, b, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    for (const panel of panels) {
      this.enter(panel);
      if (panel.plane) this.drawGround(panel);
      this.drawFaces(panel, state, MODES[state.mode]);
      if (panel.plane && state.mode === "faults") this.drawTwice(panel, state);
      if (state.seams || panel.hovered >= 0) this.drawSeams(panel, state);
    }
  }

  enter(panel) {
    const gl = this.gl;
    gl.enable(gl.SCISSOR_TEST);
    gl.viewport(panel.x, panel.y, panel.width, panel.height);
    gl.scissor(panel.x, panel.y, panel.width, panel.height);
  }

  drawGround(panel) {
    const gl = this.gl, { bounds, uvBox } = panel.layer.meta;
    gl.disable(gl.DEPTH_TEST);
    gl.useProgram(this.ground.program);
    gl.uniformMatrix4fv(this.ground.at.matrix, false, panel.matrix);
    const box = bounds.map((c, i) => (c - uvBox[i % 2]) / uvBox[2 + (i % 2)]);
    gl.uniform4fv(this.ground.at.uvBox, uvBox);
    gl.uniform4fv(this.ground.at.box, box);
    gl.bindVertexArray(this.empty);
    gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
  }

  drawFaces(panel, state, mode) {
    const gl = this.gl, u = this.fill.at, { layer } = panel, { meta } = layer;
    const own = mode === MODES.texture ? this.own : null;
    gl.useProgram(this.fill.program);
    gl.uniform3fv(u.extent, meta.extent);
    gl.uniform4fv(u.uvBox, meta.uvBox);
    gl.uniform1i(u.insideOut, meta.insideOut ? 1 : 0);
    gl.uniformMatrix4fv(u.matrix, false, panel.matrix);
    gl.uniformMatrix3fv(u.turn, false, panel.turn);
    gl.uniform1i(u.plane, panel.plane ? 1 : 0);
    gl.uniform1i(u.hovered, panel.hovered);
    gl.uniform1i(u.mode, mode);
    gl.uniform1i(u.wire, state.wire && mode < MODES.picking ? 1 : 0);
    gl.uniform1f(u.cells, meta.cells * state.density);
    gl.uniform1f(u.distortionEnd, Math.log(state.distortionEnd));
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, this.ramp);
    gl.activeTexture(gl.TEXTURE1);
    gl.bindTexture(gl.TEXTURE_2D, mode === MODES.faults ? layer.covered : this.ramp);
    if (panel.plane) gl.disable(gl.DEPTH_TEST);
    else gl.enable(gl.DEPTH_TEST);
    gl.bindVertexArray(layer.faces);
    const ranges = mode === MODES.texture && !own ? meta.ranges : [{ image: -1, first: 0, count: layer.corners / 3 }];
    for (const { image, first, count } of ranges) {
      const texture = own ?? layer.images[image];
      gl.uniform1i(u.hasImage, texture ? 1 : 0);
      if (texture) gl.bindTexture(gl.TEXTURE_2D, texture);
      gl.drawArrays(gl.TRIANGLES, 3 * first, 3 * count);
    }
  }

  /* How many faces cover each place of a layout, as a texture over the box of its uv: each face adds one. */
  count(layer) {
    const gl = this.gl, out = gl.createTexture(), framebuffer = gl.createFramebuffer();
    gl.activeTexture(gl.TEXTURE2);
    gl.bindTexture(gl.TEXTURE_2D, out);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, COUNTED, COUNTED, 0, gl.RGBA, gl.UNSIGNED_BYTE, null);
    for (const side of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, side, gl.NEAREST);
    gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, out, 0);
    const whole = { x: 0, y: 0, width: COUNTED, height: COUNTED, layer, plane: true, hovered: -1 };
    const matrix = new Float32Array([2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 1, 0, -1, -1, 0, 1]);
    this.enter(whole);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE);
    this.drawFaces({ ...whole, matrix, turn: new Float32Array(9) }, { density: 1, distortionEnd: 2 }, MODES.count);
    gl.disable(gl.BLEND);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.deleteFramebuffer(framebuffer);
    return out;
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
    this.own = this.imageTexture(bitmap, false);
  }

  drawSeams(panel, state) {
    const gl = this.gl, u = this.line.at;
    gl.useProgram(this.line.program);
    gl.uniformMatrix4fv(u.matrix, false, panel.matrix);
    gl.uniform1i(u.plane, panel.plane ? 1 : 0);
    gl.uniform1i(u.hovered, panel.hovered);
    gl.uniform2f(u.pixels, panel.width, panel.height);
    // thinner where there are many, until they are zoomed apart
    const weight = clamp(panel.layer.meta.lines[panel.plane ? "plane" : "surface"] * Math.sqrt(panel.zoom), 0.2, 1);
    gl.uniform1f(u.thickness, (panel.plane ? 1.2 : 1.5) * weight * state.ratio);
    const [r, g, b] = this.colour(this.common.schemes.light.ink); // charts are pale in both schemes
    const ink = (state.mode === "distortion" && !panel.plane ? 0.55 : 0.9) * Math.sqrt(weight);
    gl.uniform4f(u.ink, r, g, b, ink);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    gl.depthMask(false);
    gl.bindVertexArray(panel.layer.edges);
    gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, panel.layer.seams);
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
