/* From the base64 text in the page to typed arrays: what packed.py wrote. Every section is stored column by
   column and byte plane by byte plane, which compresses well. Faces stand in a tree: each is entered through an
   edge of an earlier one, and a new vertex is stored as its difference from the parallelogram over that edge. */

function bytesOf(base64) {
  if (Uint8Array.fromBase64) return Uint8Array.fromBase64(base64);
  const text = atob(base64), out = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) out[i] = text.charCodeAt(i);
  return out;
}

async function inflate(base64) {
  const stream = new Blob([bytesOf(base64)]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

const WIDTHS = { 1: Uint8Array, 2: Uint16Array, 4: Uint32Array };
const ROOT = 3; // in place of a side: the face is entered from nowhere

/* The numbers of a section as they are stored, columns interleaved. */
function readPlanes(data, offset, { count, columns, bytes }) {
  if (bytes === 1 && columns === 1) return data.subarray(offset, offset + count);
  const out = new WIDTHS[bytes](count * columns);
  for (let column = 0; column < columns; column++) {
    for (let b = 0; b < bytes; b++) {
      const shift = 8 * b;
      for (let i = 0, j = column; i < count; i++, j += columns) out[j] |= data[offset++] << shift;
    }
  }
  return out;
}

function sums(values) {
  for (let i = 1; i < values.length; i++) values[i] += values[i - 1]; // wraps, as it was stored
  return values;
}

/* index: corners of all faces. near: three earlier vertices a, b, c of each, which lies near a + b − c. */
function readTree(parent, side, corner) {
  const count = side.length, index = new Uint32Array(3 * count);
  const near = [];
  let next = 0, at = 0;
  const corners = (where, a, b, c) => {
    // distance to the next unused number: vertices are numbered in the order in which faces use them
    const v = next - corner[at++];
    index[where] = v;
    if (v === next) {
      near.push(a, b, c);
      next++;
    }
  };
  for (let f = 0, w = 0; f < count; f++, w += 3) {
    if (side[f] === ROOT) {
      for (let k = 0; k < 3; k++) {
        const last = next ? next - 1 : 0;
        corners(w + k, last, last, last);
      }
      continue;
    }
    const p = 3 * parent[f], s = side[f];
    const a = (index[w] = index[p + (s === 2 ? 0 : s + 1)]), b = (index[w + 1] = index[p + s]);
    corners(w + 2, a, b, index[p + (s === 0 ? 2 : s - 1)]);
  }
  return { index, near: Uint32Array.from(near) };
}

/* Differences from what the earlier vertices let expect → values; the sign stands in the lowest bit. */
function addPrediction(values, columns, near, parallelogram) {
  for (let v = 0, i = 0; i < values.length; v++) {
    const a = near[3 * v] * columns, b = near[3 * v + 1] * columns, c = near[3 * v + 2] * columns;
    for (let k = 0; k < columns; k++, i++) {
      const code = values[i], difference = (code >>> 1) ^ -(code & 1);
      const expected = v === 0 ? 0 : parallelogram
        ? values[a + k] + values[b + k] - values[c + k] : (values[a + k] + values[b + k]) >> 1;
      values[i] = expected + difference; // wraps
    }
  }
  return values;
}

function readSections(data, sections) {
  const out = {};
  let offset = 0;
  for (const section of sections) {
    const { name, columns, coding } = section;
    let values = readPlanes(data, offset, section);
    if (coding === "sum") values = sums(values);
    else if (coding !== "plain") values = addPrediction(values, columns, out.near, coding === "parallelogram");
    out[name] = values;
    if (name === "corner") Object.assign(out, readTree(out.parent, out.side, out.corner));
    offset += section.count * columns * section.bytes;
  }
  for (const name of ["parent", "side", "corner", "near"]) delete out[name];
  return out;
}
