/* Layouts beside each other: which are shown, which one is listed, and how one chooses. */

const BESIDE = 4; // at most; a narrow screen has room for two
const most = () => (matchMedia("(max-width: 820px)").matches ? 2 : BESIDE);

/* Put the layouts that are shown in columns, and mark the active one. */
function arrange(state, all) {
  document.body.classList.toggle("beside", state.shown.length > 1);
  for (const one of all) {
    one.box.hidden = !state.shown.includes(one);
    one.box.toggleAttribute("data-active", one === state.active);
  }
  for (const cell of document.querySelectorAll("[data-figures]"))
    cell.hidden = !state.shown.some((one) => one.k === Number(cell.dataset.figures));
  for (const input of document.querySelectorAll("input[name=layout]")) {
    const one = all[Number(input.value)];
    input.checked = state.shown.includes(one);
    input.parentElement.hidden = one.meta.mesh !== state.active.meta.mesh;
  }
}

/* Boxes for the layouts, a list of the meshes, and keys: b one alone or beside others, [ and ] the one before and
   after. Resolves when the first ones are shown. */
function wireLayouts(common, all, state, show) {
  const of = (mesh) => all.filter((one) => one.meta.mesh === mesh);
  const first = (mesh) => of(mesh).slice(0, most());
  for (const input of document.querySelectorAll("input[name=layout]")) {
    input.addEventListener("change", () => {
      const one = all[Number(input.value)];
      let shown = state.shown.filter((other) => other !== one);
      if (input.checked) shown = [...shown, one].slice(-most()).sort((a, b) => a.k - b.k);
      show(shown.length ? shown : [one]);
    });
  }
  $("of-mesh")?.addEventListener("change", (event) => show(first(Number(event.target.value))));
  for (const button of document.querySelectorAll("button[data-show]")) {
    button.addEventListener("click", () => {
      const one = all[Number(button.dataset.show)];
      if ($("of-mesh")) $("of-mesh").value = one.meta.mesh;
      show([one], one);
      $("stage").scrollIntoView({ block: "start" });
      one.surface.focus({ preventScroll: true });
    });
  }
  document.addEventListener("keydown", (event) => {
    const typing = event.target.matches?.("input[type=range], input[type=file], select");
    if (typing || event.ctrlKey || event.metaKey || event.altKey || all.length < 2) return;
    const mine = of(state.active.meta.mesh), at = mine.indexOf(state.active);
    if (event.key === "b") {
      const from = Math.max(0, Math.min(at, mine.length - most()));
      show(state.shown.length > 1 ? [state.active] : mine.slice(from, from + most()));
    } else if (event.key === "[" || event.key === "]") {
      const next = mine[(at + (event.key === "]" ? 1 : -1) + mine.length) % mine.length];
      const others = state.shown.filter((one) => one !== state.active && one !== next);
      show([next, ...others].sort((a, b) => a.k - b.k), next).then(() => next.surface.focus({ preventScroll: true }));
    } else return;
    event.preventDefault();
  });
  return all.length > 1 ? show(first(0), all[common.active]) : Promise.resolve();
}
