/* The page: reads the data, keeps the state, draws when something has changed. A page shows one layout, or several
   side by side: before and after, or those of several methods. Each is unpacked when it is first shown. */

const $ = (id) => document.getElementById(id);
const number = (x, digits = 0) => x.toLocaleString("en", { maximumFractionDigits: digits });

/* A layout of the page: its data, its panels, and the camera of its plane. */
class Shown {
  constructor(meta, k, surfaceCamera) {
    const [surface, plane] = document.querySelectorAll(`.layout[data-layout="${k}"] .panel`);
    Object.assign(this, { meta, k, surface, plane, mesh: null, layer: null });
    this.box = surface.parentElement;
    this.cameras = { surface: surfaceCamera, plane: new PlaneCamera(meta) };
  }

  async open(renderer, mark) {
    if (this.layer) return;
    const store = $(`mesh-${this.k}`), data = await inflate(store.textContent.trim());
    store.textContent = "";
    mark("inflated");
    this.mesh = readSections(data, this.meta.sections);
    mark("decoded");
    this.layer = new Layer(renderer, this.meta, this.mesh);
  }

  /* What the renderer draws of it: two panels, in pixels from the bottom left of the stage. */
  panels(outer, ratio, hovered) {
    return ["surface", "plane"].map((name) => {
      const r = this[name].getBoundingClientRect();
      return {
        x: Math.round((r.left - outer.left) * ratio), y: Math.round((outer.bottom - r.bottom) * ratio),
        width: Math.round(r.width * ratio), height: Math.round(r.height * ratio),
        ...this.cameras[name].view(r.width, r.height, this.meta), layer: this.layer, hovered,
      };
    });
  }
}

async function start() {
  const common = JSON.parse($("meta").textContent);
  const canvas = $("canvas"), stage = $("stage");
  const renderer = new Renderer(canvas, common);
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const scheme = () => renderer.setScheme(common.schemes[dark.matches ? "dark" : "light"]);
  if (matchMedia("(pointer: coarse)").matches) common.hint = common.touchHint;
  $("hovered").textContent = common.hint;
  // one camera for all layouts of a mesh: they turn together
  const orbits = common.layouts.map(() => null);
  const all = common.layouts.map((meta, k) => new Shown(meta, k, (orbits[meta.mesh] ??= new OrbitCamera(meta))));
  const state = {
    mode: "checker", density: 1, distortionEnd: common.distortionEnd, seams: true, hovered: -1, locked: -1, wire: false,
    ratio: 1, active: all[0], shown: [all[0]],
  };
  let waiting = false, pickingStale = true, table = null;

  const panels = () => {
    const outer = stage.getBoundingClientRect();
    return state.shown.filter((one) => one.layer)
      .flatMap((one) => one.panels(outer, state.ratio, one === state.active ? state.hovered : -1));
  };
  const draw = () => {
    waiting = false;
    state.ratio = Math.min(window.devicePixelRatio || 1, 2);
    const width = Math.round(stage.clientWidth * state.ratio), height = Math.round(stage.clientHeight * state.ratio);
    if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
    renderer.draw(panels(), state);
  };
  const redraw = () => {
    if (!waiting) requestAnimationFrame(draw);
    waiting = true;
  };
  const moved = () => {
    pickingStale = true;
    redraw();
  };
  const reset = () => {
    for (const one of state.shown) Object.values(one.cameras).forEach((camera) => camera.reset());
    moved();
  };

  /* Take the charts of a layout: what is pointed at, locked and listed is one of them. */
  const activate = (one) => {
    if (one === state.active) return;
    if (state.locked >= 0) reset();
    state.hovered = state.locked = -1;
    state.active = one;
    describe(common, state);
    table.show(one.meta);
    arrange(state, all);
    redraw();
  };
  const select = (chart) => {
    if (state.locked >= 0) chart = state.locked;
    if (chart === state.hovered) return;
    state.hovered = chart;
    describe(common, state);
    redraw();
  };
  /* Stay at a chart and show it large in both views; −1 lets it go. */
  const lock = (chart) => {
    if (chart === state.locked) chart = -1;
    state.locked = state.hovered = chart;
    describe(common, state);
    table.mark(chart);
    if (chart < 0) return reset();
    const { mesh, meta, cameras } = state.active, part = chartPart(mesh, meta, chart);
    cameras.plane.lookAt(part.box);
    cameras.surface.lookAt(part, meta);
    moved();
  };
  const step = (one, by) => {
    activate(one);
    const n = one.meta.charts.faces.length, go = state.locked < 0 ? select : lock;
    go((state.hovered < 0 ? (by > 0 ? 0 : n - 1) : state.hovered + by + n) % n);
  };
  const chartAt = (x, y) => {
    const r = stage.getBoundingClientRect();
    if (!(x >= r.left && y >= r.top && x < r.right && y < r.bottom)) return -1;
    if (pickingStale) renderer.drawPicking(panels(), state);
    pickingStale = false;
    return renderer.chartAt(x - r.left, y - r.top);
  };
  const hover = (one, x, y, tapped = false) => {
    const chart = chartAt(x, y);
    if (one !== state.active) {
      if (chart < 0 || (state.locked >= 0 && !tapped)) return;
      activate(one);
    }
    const again = tapped && chart >= 0 && chart === state.hovered;
    if (again || (tapped && chart < 0 && state.locked >= 0)) lock(again ? chart : -1);
    else select(chart);
  };
  const click = (one, x, y) => {
    const chart = chartAt(x, y);
    activate(one);
    if (chart >= 0 || state.locked >= 0) lock(chart);
  };
  /* Show these layouts beside each other. */
  const show = async (shown, active = shown.includes(state.active) ? state.active : shown[0]) => {
    if (state.locked >= 0) lock(-1);
    state.shown = shown;
    activate(active);
    arrange(state, all);
    for (const one of shown) {
      if (one.layer) continue;
      await one.open(renderer, () => {});
      loadImages(one, renderer, redraw);
    }
    moved();
  };

  const mark = (name) => performance.mark(name);
  arrange(state, all);
  await all[0].open(renderer, mark);
  renderer.finish();
  scheme();
  mark("uploaded");
  draw();
  mark("drawn");
  table = wireTable(lock);
  table.show(all[0].meta);
  for (const one of all) {
    for (const name of ["surface", "plane"]) {
      control(one[name], one.cameras[name], moved, hover.bind(null, one), step.bind(null, one), click.bind(null, one));
    }
  }
  loadImages(all[0], renderer, redraw);
  wireTools(common, state, renderer, { redraw, draw, lock, canvas });
  dark.addEventListener("change", () => (scheme(), redraw()));
  $("reset").addEventListener("click", () => (state.locked >= 0 ? lock(state.locked) : reset()));
  $("seams").addEventListener("change", (event) => ((state.seams = event.target.checked), redraw()));
  wireModes(common, state, redraw);
  wireSliders(common, state, redraw);
  const last = all.at(-1);
  const morph = (mesh) => (last.layer.setGeometry(mesh), moved());
  canvas.addEventListener("webglcontextlost", () => fail("the graphics driver was reset: reload the page"));
  await wireLayouts(common, all, state, show);
  if (last.meta.targets) wireMorphs(last.meta.targets, last.mesh, morph);
  new ResizeObserver(moved).observe(stage);
  draw();
  document.body.dataset.ready = "yes";
}

/* The line below the pictures: what lies under the pointer. */
function describe(common, { active, hovered: chart, locked, shown }) {
  const c = active.meta.charts;
  $("hovered").textContent = chart < 0 ? common.hint : [
    ...(shown.length > 1 ? [active.meta.name] : []),
    `Chart ${number(chart + 1)} of ${number(c.faces.length)}`,
    `${number(c.faces[chart])} faces`,
    `${number(100 * c.share[chart], 2)} % of the surface`,
    `distortion ${number(c.distortion[chart], 3)}`,
    ...(locked >= 0 ? ["locked: Esc lets go"] : []),
  ].join("  ·  ");
}

function wireModes(common, state, redraw) {
  const show = () => {
    for (const name of ["checker", "distortion", "density"]) $(`${name}-tool`).hidden = state.mode !== name;
    redraw();
  };
  for (const input of document.querySelectorAll("input[name=mode]")) {
    if (input.value === "texture" && !common.layouts.some((meta) => meta.images.length)) {
      input.disabled = true;
      input.parentElement.title = `${common.layouts.at(-1).imageNote}; drop an image on the page to see it`;
    }
    input.addEventListener("change", () => ((state.mode = input.value), show()));
  }
  show();
}

function wireSliders(common, state, redraw) {
  const density = $("density"), end = $("scale");
  density.addEventListener("input", () => {
    state.density = 2 ** Number(density.value);
    const cells = state.active.meta.cells * state.density;
    $("density-value").textContent = `${number(cells, cells < 10 ? 1 : 0)} a unit`;
    redraw();
  });
  end.max = common.distortionEnds.length - 1;
  end.value = common.distortionEnds.indexOf(common.distortionEnd);
  const show = () => {
    state.distortionEnd = common.distortionEnds[Number(end.value)];
    $("scale-value").textContent = `${state.distortionEnd} or more`;
    redraw();
  };
  end.addEventListener("input", show);
  density.dispatchEvent(new Event("input"));
  show();
  $("bar").style.background = `linear-gradient(90deg, ${common.ramp.join(",")})`;
}

function loadImages({ meta, layer }, renderer, redraw) {
  meta.images.forEach((source, slot) => {
    const image = new Image();
    image.onload = () => {
      layer.images[slot] = renderer.imageTexture(image);
      redraw();
    };
    image.src = source;
  });
}

function fail(message) {
  $("failure").hidden = false;
  $("failure").textContent = `The interactive view cannot be shown: ${message}. The figures stand beside it.`;
}

start().catch((error) => fail(error.message));
