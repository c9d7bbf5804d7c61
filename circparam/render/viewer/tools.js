/* What an artist does with the page: a table of charts, keys for everything, an own image, full screen, a PNG. */

const ROWS = 500; // of the table; more than that nobody reads

/* Where a chart lies: its box in uv; its middle and radius on the surface, and its mean normal. */
function chartPart(mesh, meta, chart) {
  const { index, position, uv } = mesh, [u0, v0, w, h] = meta.uvBox, { extent } = meta;
  const box = [Infinity, Infinity, -Infinity, -Infinity], normal = [0, 0, 0];
  const low = [1, 1, 1], high = [0, 0, 0];
  const point = (v) => [0, 1, 2].map((k) => position[3 * v + k] / 65535);
  mesh.chart.forEach((c, f) => {
    if (c !== chart) return;
    const corners = [0, 1, 2].map((k) => index[3 * f + k]), p = corners.map(point);
    for (const v of corners) {
      const at = [u0 + (uv[2 * v] / 65535) * w, v0 + (uv[2 * v + 1] / 65535) * h];
      for (let k = 0; k < 2; k++) {
        box[k] = Math.min(box[k], at[k]);
        box[2 + k] = Math.max(box[2 + k], at[k]);
      }
    }
    for (const q of p) {
      for (let k = 0; k < 3; k++) {
        low[k] = Math.min(low[k], q[k]);
        high[k] = Math.max(high[k], q[k]);
      }
    }
    const side = (a, b) => a.map((x, k) => (x - b[k]) * extent[k]);
    cross(side(p[1], p[0]), side(p[2], p[0])).forEach((x, k) => (normal[k] += meta.insideOut ? -x : x));
  });
  const middle = low.map((x, k) => (x + high[k]) / 2);
  return { box, normal, middle, radius: Math.hypot(...low.map((x, k) => (high[k] - x) * extent[k])) / 2 };
}

/* The table of charts of one layout: a heading sorts, a row locks its chart. Returns `show`, which fills it, and
   `mark`, which marks the row of a chart. */
function wireTable(lock) {
  const body = $("charts").tBodies[0];
  let locked = -1, sorted = 0, up = true, c = { faces: [] }, order = [], columns = [];
  const mark = (chart) => {
    locked = chart;
    for (const row of body.rows) row.toggleAttribute("data-locked", Number(row.dataset.chart) === chart);
  };
  const fill = () => {
    const by = columns[sorted];
    const ranked = [...order].sort((a, b) => (by[a] - by[b]) * (up ? 1 : -1) || a - b).slice(0, ROWS);
    body.replaceChildren(...ranked.map((k) => {
      const row = document.createElement("tr"), button = document.createElement("button");
      row.dataset.chart = k;
      button.type = "button";
      button.textContent = number(k + 1);
      row.insertCell().append(button);
      for (const text of [number(c.faces[k]), number(100 * c.share[k], 2), number(c.distortion[k], 3)])
        row.insertCell().textContent = text;
      row.addEventListener("click", () => lock(k));
      return row;
    }));
    mark(locked);
  };
  $("charts").querySelectorAll("th").forEach((head, k) => head.firstElementChild.addEventListener("click", () => {
    up = k === sorted ? !up : k === 0;
    sorted = k;
    $("charts").querySelectorAll("th").forEach((h, i) => i === k
      ? h.setAttribute("aria-sort", up ? "ascending" : "descending") : h.removeAttribute("aria-sort"));
    fill();
  }));
  const show = (meta) => {
    c = meta.charts;
    order = c.faces.map((_, k) => k);
    columns = [order, c.faces, c.share, c.distortion];
    locked = -1;
    $("more-charts").hidden = order.length <= ROWS;
    const of = $("charts-of");
    if (of) of.textContent = meta.name;
    fill();
  };
  return { mark, show };
}

/* Wireframe, an own image, full screen, the picture as a file; and a key for each. */
function wireTools(common, state, renderer, { redraw, draw, lock, canvas }) {
  $("wire").addEventListener("change", (event) => ((state.wire = event.target.checked), redraw()));
  const show = async (file) => {
    if (!file) return;
    try {
      renderer.setOwnImage(await createImageBitmap(file, { imageOrientation: "flipY" }));
    } catch {
      $("hovered").textContent = `${file.name} is no image that this browser reads`;
      return;
    }
    const input = document.querySelector("input[name=mode][value=texture]");
    input.disabled = false;
    input.click();
    redraw();
  };
  $("image").addEventListener("change", (event) => show(event.target.files[0]));
  document.addEventListener("dragover", (event) => event.preventDefault());
  document.addEventListener("drop", (event) => (event.preventDefault(), show(event.dataTransfer.files[0])));
  const full = () => (document.fullscreenElement ? document.exitFullscreen() : document.documentElement.requestFullscreen());
  const save = () => {
    draw(); // what is drawn is there until the browser shows it
    const link = document.createElement("a");
    link.href = canvas.toDataURL("image/png");
    link.download = `${document.title}.png`;
    link.click();
  };
  $("full").addEventListener("click", full);
  $("save").addEventListener("click", save);
  const modes = [...document.querySelectorAll("input[name=mode]")];
  document.addEventListener("keydown", (event) => {
    const typing = event.target.matches?.("input[type=range], input[type=file], select");
    if (typing || event.ctrlKey || event.metaKey || event.altKey) return;
    const key = event.key.toLowerCase();
    if (key >= "1" && key <= String(modes.length)) modes[key - 1].click();
    else if (key === "w" || key === "s") $(key === "w" ? "wire" : "seams").click();
    else if (key === "i") $("image").click();
    else if (key === "f") full();
    else if (key === "p") save();
    else if (key === "escape") lock(-1);
    else if (key === "enter" && event.target.matches?.(".panel") && state.hovered >= 0) lock(state.hovered);
    else return;
    event.preventDefault();
  });
}
