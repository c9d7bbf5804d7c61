/* The table of all files: sorted by a click on a heading, searched, drawn a few hundred rows at a time. */

const { heads, rows, kinds } = JSON.parse(document.getElementById("data").textContent);
const STEP = 200;
const table = document.getElementById("files");
const body = table.tBodies[0];
const more = document.getElementById("more");
const numeric = heads.map((head) => head.numeric);
let shown = rows, drawn = 0;

const text = (value, k) => (value === null ? "–" : k === 1 ? kinds[value] : String(value));

function cell(value, k) {
  const out = document.createElement(k ? "td" : "th");
  if (!k) out.scope = "row";
  out.textContent = text(value, k);
  return out;
}

function draw(fresh) {
  if (fresh) { body.replaceChildren(); drawn = 0; }
  for (const row of shown.slice(drawn, drawn + STEP)) {
    const line = document.createElement("tr");
    line.append(...row.map(cell));
    body.append(line);
  }
  drawn = Math.min(drawn + STEP, shown.length);
  more.hidden = drawn >= shown.length;
  document.getElementById("count").textContent = `${shown.length.toLocaleString("en")} of ${rows.length.toLocaleString("en")}`;
}

heads.forEach((head, k) => {
  const place = document.createElement("th");
  place.scope = "col";
  const button = document.createElement("button");
  button.type = "button";
  button.textContent = head.name;
  button.addEventListener("click", () => {
    const down = place.getAttribute("aria-sort") === "ascending";
    for (const other of table.tHead.rows[0].cells) other.removeAttribute("aria-sort");
    place.setAttribute("aria-sort", down ? "descending" : "ascending");
    const compare = (a, b) => {
      const x = a[k], y = b[k];
      if (x === null || y === null) return (x === null) - (y === null);   // empty cells stay last
      const order = numeric[k] ? x - y : text(x, k).localeCompare(text(y, k));
      return down ? -order : order;
    };
    rows.sort(compare);
    if (shown !== rows) shown.sort(compare);
    draw(true);
  });
  place.append(button);
  table.tHead.rows[0].append(place);
});

document.getElementById("find").addEventListener("input", (event) => {
  const word = event.target.value.toLowerCase();
  const last = heads.length - 1;
  shown = word ? rows.filter((r) => [r[0], kinds[r[1]], r[last] ?? ""].some((t) => t.toLowerCase().includes(word))) : rows;
  draw(true);
});
more.addEventListener("click", () => draw(false));
draw(true);
