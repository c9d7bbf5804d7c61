/* The page: reads the data, keeps the state, draws when something has changed. */

const $ = (id) => document.getElementById(id);
const number = (x, digits = 0) => x.toLocaleString("en", { maximumFractionDigits: digits });

async function start() {
  const meta = JSON.parse($("meta").textContent);
  const data = await inflate($("mesh").textContent.trim());
  $("mesh").textContent = "";
  performance.mark("inflated");
  const mesh = readSections(data, meta.sections);
  performance.mark("decoded");
  const canvas = $("canvas"), stage = $("stage");
  const renderer = new Renderer(canvas, meta, mesh);
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const scheme = () => renderer.setScheme(meta.schemes[dark.matches ? "dark" : "light"]);
  scheme();
  if (matchMedia("(pointer: coarse)").matches) meta.hint = meta.touchHint;
  $("hovered").textContent = meta.hint;
  performance.mark("uploaded");
  const state = {
    mode: "checker", cells: meta.cells, distortionEnd: meta.distortionEnd, seams: true, hovered: -1, locked: -1, wire: false,
    ratio: 1,
  };
  const cameras = { surface: new OrbitCamera(meta), plane: new PlaneCamera(meta) };
  let waiting = false, pickingStale = true;

  const panels = () => ["surface", "plane"].map((name) => {
    const outer = stage.getBoundingClientRect(), r = $(name).getBoundingClientRect(), k = state.ratio;
    return {
      x: Math.round((r.left - outer.left) * k), y: Math.round((outer.bottom - r.bottom) * k),
      width: Math.round(r.width * k), height: Math.round(r.height * k),
      ...cameras[name].view(r.width, r.height),
    };
  });

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

  const select = (chart) => {
    if (state.locked >= 0) chart = state.locked;
    if (chart === state.hovered) return;
    state.hovered = chart;
    describe(meta, chart, state.locked >= 0);
    redraw();
  };
  /* Stay at a chart and show it large in both views; −1 lets it go. */
  const lock = (chart) => {
    if (chart === state.locked) chart = -1;
    state.locked = state.hovered = chart;
    describe(meta, chart, chart >= 0);
    table.mark(chart);
    if (chart < 0) Object.values(cameras).forEach((camera) => camera.reset());
    else {
      const part = chartPart(mesh, meta, chart);
      cameras.plane.lookAt(part.box);
      cameras.surface.lookAt(part.middle, part.radius, part.normal);
    }
    moved();
  };
  const table = wireTable(meta, lock);
  const step = (by) => {
    const n = meta.charts.faces.length, go = state.locked < 0 ? select : lock;
    go((state.hovered < 0 ? (by > 0 ? 0 : n - 1) : state.hovered + by + n) % n);
  };
  const chartAt = (x, y) => {
    const r = stage.getBoundingClientRect();
    let chart = -1;
    if (x >= r.left && y >= r.top && x < r.right && y < r.bottom) {
      if (pickingStale) renderer.drawPicking(panels(), state);
      pickingStale = false;
      chart = renderer.chartAt(x - r.left, y - r.top);
    }
    return chart;
  };
  const hover = (x, y, tapped = false) => {
    const chart = chartAt(x, y), again = tapped && chart >= 0 && chart === state.hovered;
    if (again || (tapped && chart < 0 && state.locked >= 0)) lock(again ? chart : -1);
    else select(chart);
  };
  const click = (x, y) => {
    const chart = chartAt(x, y);
    if (chart >= 0 || state.locked >= 0) lock(chart);
  };

  for (const name of ["surface", "plane"]) control($(name), cameras[name], moved, hover, step, click);
  wireTools(meta, state, renderer, { redraw, draw, lock, canvas });
  dark.addEventListener("change", () => (scheme(), redraw()));
  $("reset").addEventListener("click", () => {
    if (state.locked >= 0) return lock(state.locked);
    Object.values(cameras).forEach((camera) => camera.reset());
    moved();
  });
  $("seams").addEventListener("change", (event) => ((state.seams = event.target.checked), redraw()));
  wireModes(meta, state, redraw);
  wireSliders(meta, state, redraw);
  wireMorphs(meta, mesh, renderer, moved);
  loadImages(meta, renderer, redraw);
  canvas.addEventListener("webglcontextlost", () => fail("the graphics driver was reset: reload the page"));
  new ResizeObserver(moved).observe(stage);
  draw();
  performance.mark("drawn");
  document.body.dataset.ready = "yes";
}

/* The line below the pictures: what lies under the pointer. */
function describe(meta, chart, locked = false) {
  const c = meta.charts;
  $("hovered").textContent = chart < 0 ? meta.hint : [
    `Chart ${number(chart + 1)} of ${number(c.faces.length)}`,
    `${number(c.faces[chart])} faces`,
    `${number(100 * c.share[chart], 2)} % of the surface`,
    `distortion ${number(c.distortion[chart], 3)}`,
    ...(locked ? ["locked: Esc lets go"] : []),
  ].join("  ·  ");
}

function wireModes(meta, state, redraw) {
  const show = () => {
    for (const name of ["checker", "distortion", "density"]) $(`${name}-tool`).hidden = state.mode !== name;
    redraw();
  };
  for (const input of document.querySelectorAll("input[name=mode]")) {
    if (input.value === "texture" && !meta.images.length) {
      input.disabled = true;
      input.parentElement.title = `${meta.imageNote}; drop an image on the page to see it`;
    }
    input.addEventListener("change", () => ((state.mode = input.value), show()));
  }
  show();
}

function wireSliders(meta, state, redraw) {
  const density = $("density"), end = $("scale");
  density.addEventListener("input", () => {
    state.cells = meta.cells * 2 ** Number(density.value);
    $("density-value").textContent = `${number(state.cells, state.cells < 10 ? 1 : 0)} a unit`;
    redraw();
  });
  end.max = meta.distortionEnds.length - 1;
  end.value = meta.distortionEnds.indexOf(meta.distortionEnd);
  const show = () => {
    state.distortionEnd = meta.distortionEnds[Number(end.value)];
    $("scale-value").textContent = `${state.distortionEnd} or more`;
    redraw();
  };
  end.addEventListener("input", show);
  density.dispatchEvent(new Event("input"));
  show();
  $("bar").style.background = `linear-gradient(90deg, ${meta.ramp.join(",")})`;
}

function loadImages(meta, renderer, redraw) {
  meta.images.forEach((source, slot) => {
    const image = new Image();
    image.onload = () => {
      renderer.addImage(slot, image);
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
