/* From the base64 text in the page to typed arrays. Every section is stored column by column and byte
   plane by byte plane (which compresses well), as differences where that helps. */

async function inflate(base64) {
  const text = atob(base64);
  const packed = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) packed[i] = text.charCodeAt(i);
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

const WIDTHS = { 1: Uint8Array, 2: Uint16Array, 4: Uint32Array };

/* One section: {count, columns, bytes, coding} at an offset → an array with interleaved columns. */
function readSection(data, offset, section) {
  const { count, columns, bytes, coding } = section;
  const out = new WIDTHS[bytes](count * columns);
  for (let column = 0; column < columns; column++) {
    for (let b = 0; b < bytes; b++) {
      const shift = 8 * b;
      for (let i = 0, j = column; i < count; i++, j += columns) out[j] |= data[offset++] << shift;
    }
  }
  if (coding === "delta") {
    for (let i = columns; i < out.length; i++) out[i] += out[i - columns]; // wraps, as it was stored
  } else if (coding === "newest") {
    // distance to the next unused number: vertices are numbered in the order in which faces use them
    let next = 0;
    for (let i = 0; i < out.length; i++) {
      out[i] = next - out[i];
      if (out[i] === next) next++;
    }
  }
  return out;
}

function readSections(data, sections) {
  const out = {};
  let offset = 0;
  for (const section of sections) {
    out[section.name] = readSection(data, offset, section);
    offset += section.count * section.columns * section.bytes;
  }
  return out;
}
