/* The two cameras, and what a mouse, a finger, a wheel or a key does to them. */

const multiply = (a, b) => {
  const out = new Float32Array(16);
  for (let c = 0; c < 4; c++)
    for (let r = 0; r < 4; r++)
      for (let k = 0; k < 4; k++) out[4 * c + r] += a[4 * k + r] * b[4 * c + k];
  return out;
};

const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const unit = (a) => a.map((c) => c / (Math.hypot(...a) || 1));
const clamp = (x, low, high) => Math.min(Math.max(x, low), high);

const radiusOf = (meta) => Math.hypot(...meta.extent) / 2 || 1;

/* Turns about the upright axis and tilts against it; never rolls. */
class OrbitCamera {
  constructor(meta) {
    this.direction = meta.direction;
    this.up = meta.up;
    this.side = [meta.up[2], meta.up[0], meta.up[1]];
    this.front = cross(this.side, this.up);
    this.reset();
  }

  reset() {
    const d = unit(this.direction);
    this.pitch = Math.asin(clamp(dot(d, this.up), -1, 1));
    this.yaw = Math.atan2(dot(d, this.side), dot(d, this.front));
    this.zoom = 1;
    this.pan = [0, 0];
  }

  axes() {
    const { yaw, pitch, up, side, front } = this;
    const back = [0, 1, 2].map(
      (i) => Math.cos(pitch) * (Math.cos(yaw) * front[i] + Math.sin(yaw) * side[i]) + Math.sin(pitch) * up[i],
    );
    const right = [0, 1, 2].map((i) => Math.cos(yaw) * side[i] - Math.sin(yaw) * front[i]);
    return [right, cross(back, right), back];
  }

  /* Several layouts share the camera: meta is that of the mesh that is seen. */
  view(width, height, meta) {
    const { extent } = meta, radius = radiusOf(meta);
    const axes = this.axes();
    const tangent = Math.tan(0.3); // half the field of view
    const short = Math.min(1, width / height);
    const distance = radius * (1 / (Math.sin(0.3) * short * 1.12) / this.zoom);
    const near = Math.max(distance - 1.05 * radius, distance * 0.02), far = distance + 1.05 * radius;
    const projection = new Float32Array(16);
    projection[0] = height / width / tangent;
    projection[5] = 1 / tangent;
    projection[10] = -(far + near) / (far - near);
    projection[11] = -1;
    projection[14] = (-2 * far * near) / (far - near);
    const model = new Float32Array(16);
    axes.forEach((axis, row) => {
      for (let k = 0; k < 3; k++) model[4 * k + row] = axis[k] * extent[k];
      model[12 + row] = -dot(axis, extent) / 2;
    });
    model[12] += this.pan[0] * radius;
    model[13] += this.pan[1] * radius;
    model[14] -= distance;
    model[15] = 1;
    const turn = new Float32Array(9);
    axes.forEach((axis, row) => axis.forEach((c, k) => (turn[3 * k + row] = c)));
    return { matrix: multiply(projection, model), turn, plane: false, zoom: this.zoom };
  }

  /* Look at a part from its front: the middle and radius in stored numbers, and the mean normal. */
  lookAt({ middle, radius, normal }, meta) {
    const whole = radiusOf(meta);
    const d = unit(normal);
    this.pitch = Math.asin(clamp(dot(d, this.up), -1, 1));
    this.yaw = Math.atan2(dot(d, this.side), dot(d, this.front));
    this.zoom = clamp((0.9 * whole) / (radius || 1), 1, 40);
    const [right, up] = this.axes();
    const from = middle.map((c, k) => (c - 0.5) * meta.extent[k]);
    this.pan = [-dot(right, from) / whole, -dot(up, from) / whole];
  }

  drag(dx, dy, shift, size) {
    if (shift) {
      this.pan[0] += (2.3 * dx) / size / this.zoom;
      this.pan[1] -= (2.3 * dy) / size / this.zoom;
    } else {
      this.yaw -= (4 * dx) / size;
      this.pitch = clamp(this.pitch + (4 * dy) / size, -1.57, 1.57);
    }
  }

  scale(factor) {
    this.zoom = clamp(this.zoom * factor, 0.3, 40);
  }
}

/* Looks straight at the plane; zooms about the place under the pointer. */
class PlaneCamera {
  constructor(meta) {
    const [u0, v0, w, h] = meta.uvBox, [a, b, c, d] = meta.bounds;
    this.home = [(a + c) / 2, (b + d) / 2];
    this.span = Math.max(c - a, d - b) * 1.06;
    this.box = [u0, v0, w, h];
    this.reset();
  }

  reset() {
    this.centre = [...this.home];
    this.zoom = 1;
  }

  view(width, height) {
    const [u0, v0, w, h] = this.box;
    const sx = (2 * this.zoom * Math.min(1, height / width)) / this.span;
    const sy = (2 * this.zoom * Math.min(1, width / height)) / this.span;
    const matrix = new Float32Array(16);
    matrix[0] = w * sx;
    matrix[5] = h * sy;
    matrix[10] = matrix[15] = 1;
    matrix[12] = (u0 - this.centre[0]) * sx;
    matrix[13] = (v0 - this.centre[1]) * sy;
    return { matrix, turn: new Float32Array([1, 0, 0, 0, 1, 0, 0, 0, 1]), plane: true, zoom: this.zoom };
  }

  /* Show a part: its box [low u, low v, high u, high v] in uv. */
  lookAt(box) {
    this.centre = [(box[0] + box[2]) / 2, (box[1] + box[3]) / 2];
    this.zoom = clamp((0.8 * this.span) / (Math.max(box[2] - box[0], box[3] - box[1]) || 1), 0.5, 400);
  }

  drag(dx, dy, shift, size) {
    this.centre[0] -= (dx / size / this.zoom) * this.span;
    this.centre[1] += (dy / size / this.zoom) * this.span;
  }

  scale(factor, x, y, size) {
    const before = this.zoom;
    this.zoom = clamp(this.zoom * factor, 0.5, 400);
    const move = (this.span / size) * (1 / before - 1 / this.zoom);
    this.centre[0] += x * move;
    this.centre[1] -= y * move;
  }
}

/* Wire a panel: drag, wheel, pinch, tap, keys, double click. changed(): draw again; hover(x, y) in page pixels;
   step(±1): the next or last chart; lock(x, y): stay at the chart there. A finger selects with a tap; where the page scrolls, the browser takes
   vertical swipes for itself and cancels the pointer. */
function control(panel, camera, changed, hover, step, lock) {
  const fingers = new Map();
  const TAP = 8; // pixels that a finger may slip
  let slipped = 0, first = [0, 0], scrolls = false;
  const size = () => Math.min(panel.clientWidth, panel.clientHeight);
  const middle = (event) => {
    const r = panel.getBoundingClientRect();
    return [event.clientX - r.left - r.width / 2, event.clientY - r.top - r.height / 2];
  };
  const gap = () => {
    const [a, b] = [...fingers.values()];
    return Math.hypot(a[0] - b[0], a[1] - b[1]);
  };
  panel.addEventListener("pointerdown", (event) => {
    panel.setPointerCapture(event.pointerId);
    slipped = fingers.size ? Infinity : 0;
    first = middle(event);
    scrolls = false;
    fingers.set(event.pointerId, middle(event));
  });
  panel.addEventListener("pointermove", (event) => {
    const last = fingers.get(event.pointerId);
    if (!last) return event.pointerType === "touch" ? undefined : hover(event.clientX, event.clientY);
    const now = middle(event);
    const before = slipped;
    slipped += Math.hypot(now[0] - last[0], now[1] - last[1]);
    if (event.pointerType === "touch" && fingers.size === 1) {
      if (slipped <= TAP) return fingers.set(event.pointerId, now);
      const upright = Math.abs(now[1] - first[1]) > Math.abs(now[0] - first[0]);
      if (before <= TAP) scrolls = upright && getComputedStyle(panel).touchAction === "pan-y";
      if (scrolls) return undefined; // the browser is about to take it
    }
    const share = 1 / fingers.size;
    const apart = fingers.size === 2 ? gap() : 0;
    fingers.set(event.pointerId, now);
    const shift = event.shiftKey || event.buttons === 2 || fingers.size > 1;
    camera.drag((now[0] - last[0]) * share, (now[1] - last[1]) * share, shift, size());
    if (apart > 0) camera.scale(gap() / apart, now[0], now[1], size());
    changed();
  });
  for (const name of ["pointerup", "pointercancel"]) {
    panel.addEventListener(name, (event) => {
      fingers.delete(event.pointerId);
      if (name !== "pointerup" || slipped > (event.pointerType === "mouse" ? 2 : TAP) || event.button > 0) return;
      if (event.pointerType === "mouse") lock(event.clientX, event.clientY);
      else hover(event.clientX, event.clientY, true);
    });
  }
  panel.addEventListener("pointerleave", (event) => {
    if (event.pointerType !== "touch") hover(NaN, NaN);
  });
  panel.addEventListener("contextmenu", (event) => event.preventDefault());
  panel.addEventListener("dblclick", () => (camera.reset(), changed()));
  panel.addEventListener("wheel", (event) => {
    event.preventDefault();
    const step = event.deltaY * [1, 16, 100][event.deltaMode];
    camera.scale(Math.exp(clamp(-step, -240, 240) / 400), ...middle(event), size());
    changed();
  }, { passive: false });
  panel.addEventListener("keydown", (event) => {
    const arrow = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
    if (arrow) camera.drag(arrow[0] * 0.05 * size(), arrow[1] * 0.05 * size(), event.shiftKey, size());
    else if (event.key === "+" || event.key === "=") camera.scale(1.2, 0, 0, size());
    else if (event.key === "-") camera.scale(1 / 1.2, 0, 0, size());
    else if (event.key === "Home") camera.reset();
    else if (event.key === "." || event.key === ",") step(event.key === "." ? 1 : -1);
    else return;
    event.preventDefault();
    changed();
  });
}
