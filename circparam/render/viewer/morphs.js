/* Between morph targets: positions and normals of all vertices for a set of weights, made anew when one changes. */

/* Two bytes of a square folded onto an octahedron → a direction, and back. */
function direction(bytes, v, out) {
  const x = (bytes[2 * v] / 255) * 2 - 1, y = (bytes[2 * v + 1] / 255) * 2 - 1;
  const z = 1 - Math.abs(x) - Math.abs(y), fold = Math.max(-z, 0);
  out[0] = x - Math.sign(x) * fold;
  out[1] = y - Math.sign(y) * fold;
  out[2] = z;
  const length = Math.hypot(out[0], out[1], z) || 1;
  for (let k = 0; k < 3; k++) out[k] /= length;
}

function folded(n, bytes, v) {
  const sum = Math.abs(n[0]) + Math.abs(n[1]) + Math.abs(n[2]) || 1;
  let x = n[0] / sum, y = n[1] / sum;
  if (n[2] < 0) [x, y] = [(1 - Math.abs(y)) * (x < 0 ? -1 : 1), (1 - Math.abs(x)) * (y < 0 ? -1 : 1)];
  bytes[2 * v] = Math.round((x * 0.5 + 0.5) * 255);
  bytes[2 * v + 1] = Math.round((y * 0.5 + 0.5) * 255);
}

/* The mesh at given weights, the rest shared with the mesh that was read. */
function morphed(mesh, weights) {
  const position = new Uint16Array(mesh.position.length), normal = new Uint8Array(mesh.normal.length);
  const active = weights.map((weight, k) => [weight, mesh[`move${k}`], mesh[`normal${k}`]]).filter(([weight]) => weight);
  for (let i = 0; i < position.length; i++) {
    const start = mesh.position[i];
    let x = start;
    for (const [weight, move] of active) x += weight * (((start + move[i]) & 0xffff) - start);
    position[i] = clamp(Math.round(x), 0, 0xffff);
  }
  const own = [0, 0, 0], there = [0, 0, 0], sum = [0, 0, 0];
  for (let v = 0; v < normal.length / 2; v++) {
    direction(mesh.normal, v, own);
    for (let k = 0; k < 3; k++) sum[k] = own[k];
    for (const [weight, , normals] of active) {
      direction(normals, v, there);
      for (let k = 0; k < 3; k++) sum[k] += weight * (there[k] - own[k]);
    }
    folded(sum, normal, v);
  }
  return { ...mesh, position, normal };
}

/* show(mesh): draw that one in place of the mesh as it was read. */
function wireMorphs(targets, mesh, show) {
  const sliders = Array.from({ length: targets }, (_, k) => $(`morph-${k}`));
  const move = () => {
    sliders.forEach((slider, k) => ($(`morph-value-${k}`).textContent = `${number(100 * slider.value)} %`));
    show(morphed(mesh, sliders.map((slider) => Number(slider.value))));
  };
  let waiting = false;
  for (const slider of sliders) {
    slider.addEventListener("input", () => {
      if (!waiting) requestAnimationFrame(() => ((waiting = false), move()));
      waiting = true;
    });
  }
  if (sliders.length) move();
}
