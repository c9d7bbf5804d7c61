/* Opens pages in headless chromium, does what a user does, and takes a screenshot after every step. One browser
   serves all visits, each in a context of its own. Called by test_browser.py: node drive.cjs CHROMIUM; a line of
   JSON {page, folder, width, height, touch, scheme, steps} on standard input is a visit, a line of JSON on
   standard output is what was seen there. */

const { chromium } = require("playwright-core");
const { createInterface } = require("readline");

const executablePath = process.argv[2];

async function pinch(session, x, y) {
  const points = (gap) => [{ x: x - gap, y, id: 1 }, { x: x + gap, y, id: 2 }];
  const send = (type, touchPoints) => session.send("Input.dispatchTouchEvent", { type, touchPoints });
  await send("touchStart", points(20));
  for (const gap of [30, 40, 50, 60]) await send("touchMove", points(gap));
  await send("touchEnd", []);
}

async function swipe(session, x, y, dx = 20, dy = 6) {
  const send = (type, touchPoints) => session.send("Input.dispatchTouchEvent", { type, touchPoints });
  await send("touchStart", [{ x, y, id: 1 }]);
  for (let k = 1; k <= 4; k++) await send("touchMove", [{ x: x + dx * k, y: y + dy * k, id: 1 }]);
  await send("touchEnd", []);
}

/* Run in the page: the lowest contrast of any text that is seen with the ground it stands on, and that text. */
function lowestContrast() {
  const parse = (c) => (c.match(/[\d.]+/g) ?? [0, 0, 0, 0]).map(Number);
  const part = (c) => ((c /= 255) <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4);
  const light = ([r, g, b]) => 0.2126 * part(r) + 0.7152 * part(g) + 0.0722 * part(b);
  const ground = (e) => {
    for (; e; e = e.parentElement) {
      const [r, g, b, a = 1] = parse(getComputedStyle(e).backgroundColor);
      if (a > 0.99) return [r, g, b];
    }
    return [255, 255, 255];
  };
  let worst = { ratio: 99, text: "" };
  for (const e of document.body.querySelectorAll("*")) {
    const own = [...e.childNodes].filter((n) => n.nodeType === 3).map((n) => n.textContent).join("").trim();
    if (!own || ["SCRIPT", "STYLE", "LEGEND"].includes(e.tagName) || !e.getClientRects().length) continue;
    const style = getComputedStyle(e);
    const colour = parse(e instanceof SVGElement ? style.fill : style.color);
    let opacity = 1;
    for (let p = e; p; p = p.parentElement) opacity *= Number(getComputedStyle(p).opacity);
    const back = ground(e);
    const front = back.map((c, i) => c + (colour[i] - c) * opacity * (colour[3] ?? 1));
    const [low, high] = [light(front), light(back)].sort((a, b) => a - b);
    const ratio = (high + 0.05) / (low + 0.05);
    if (ratio < worst.ratio) worst = { ratio, text: own.slice(0, 40) };
  }
  return worst;
}

/* Run in the page: wait until a swipe has stopped to scroll it. */
async function settled() {
  for (let still = 0, y = -1; still < 12; still = y === window.scrollY ? still + 1 : 0) {
    y = window.scrollY;
    await new Promise((done) => requestAnimationFrame(done));
  }
}

async function visit(browser, { page, folder, width, height, touch, scheme: colorScheme, steps }) {
  const context = await browser.newContext({
    viewport: { width, height }, hasTouch: touch, isMobile: touch, colorScheme,
  });
  const tab = await context.newPage();
  await tab.addInitScript(`window.lowestContrast = ${lowestContrast}`);
  const seen = { console: [], requests: [], shots: {}, text: {} };
  tab.on("console", (m) => ["error", "warning"].includes(m.type()) && seen.console.push(m.text()));
  tab.on("pageerror", (e) => seen.console.push(e.message));
  tab.on("request", (r) => r.url().startsWith("data:") || seen.requests.push(r.url()));
  await tab.goto(page);
  await tab.waitForSelector("body[data-ready=yes], body:not(:has(#stage)) table.sortable", { timeout: 120000 });
  seen.marks = await tab.evaluate(() => performance.getEntriesByType("mark").map((m) => [m.name, m.startTime]));
  for (const name of ["surface", "plane", "surface-1", "plane-1"]) seen[name] = (await tab.locator(`#${name}`).count()) ? await tab.locator(`#${name}`).boundingBox() : null;
  const session = await context.newCDPSession(tab);
  for (const [name, action, ...rest] of steps) {
    if (action === "move") await tab.mouse.move(...rest);
    if (action === "drag") {
      const [x, y, dx, dy] = rest;
      await tab.mouse.move(x, y);
      await tab.mouse.down();
      await tab.mouse.move(x + dx, y + dy, { steps: 4 });
      await tab.mouse.up();
      await tab.mouse.move(5, 5);
    }
    if (action === "wheel") {
      await tab.mouse.move(rest[0], rest[1]);
      await tab.mouse.wheel(0, rest[2]);
      await tab.mouse.move(5, 5);
    }
    if (action === "pinch") await pinch(session, ...rest);
    if (action === "swipe") {
      await swipe(session, ...rest);
      await tab.evaluate(settled);
    }
    if (action === "tap") await tab.touchscreen.tap(...rest);
    if (action === "scroll") await tab.evaluate((y) => window.scrollTo(0, y), rest[0]);
    if (action === "scheme") await tab.emulateMedia({ colorScheme: rest[0] });
    if (action === "click") await tab.click(rest[0]);
    if (action === "press") await tab.keyboard.press(rest[0]);
    if (action === "point") await tab.mouse.click(...rest);
    if (action === "file") await tab.setInputFiles(rest[0], rest[1]);
    if (action === "download") {
      const [download] = await Promise.all([tab.waitForEvent("download"), tab.click(rest[0])]);
      await download.saveAs(`${folder}/${name}-saved.png`);
    }
    if (action === "drop") {
      await tab.evaluate(async ([data, type]) => {
        const bytes = Uint8Array.from(atob(data), (c) => c.charCodeAt(0));
        const transfer = new DataTransfer();
        transfer.items.add(new File([bytes], "dropped.png", { type }));
        document.dispatchEvent(new DragEvent("drop", { dataTransfer: transfer, cancelable: true }));
      }, rest);
      await tab.waitForFunction(() => document.querySelector("input[value=texture]").checked
        || document.getElementById("hovered").textContent.includes("no image"));
    }
    if (action === "choose") await tab.selectOption(rest[0], rest[1]);
    if (action === "key") await tab.press(rest[0], rest[1]);
    if (action === "fill") await tab.locator(rest[0]).fill(rest[1]);
    await tab.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))));
    seen.shots[name] = `${folder}/${name}.png`;
    await tab.screenshot({ path: seen.shots[name], fullPage: action === "full" });
    seen.text[name] = await tab.evaluate(() => ({
      hovered: document.getElementById("hovered")?.textContent ?? "",
      first: document.querySelector("table.sortable tbody th")?.textContent ?? "",
      scroll: window.scrollY,
      mode: document.querySelector("input[name=mode]:checked")?.value ?? "",
      wire: document.getElementById("wire")?.checked ?? false,
      seams: document.getElementById("seams")?.checked ?? false,
      charts: [...document.querySelectorAll("#charts tbody tr")].map((r) => Number(r.dataset.chart)),
      locked: [...document.querySelectorAll("#charts [data-locked]")].map((r) => Number(r.dataset.chart)),
      full: document.fullscreenElement !== null,
      layouts: [...document.querySelectorAll(".layout:not([hidden]) .surface-name")].map((h) => h.textContent),
      boxes: [...document.querySelectorAll("input[name=layout]")].filter((b) => b.getClientRects().length)
        .map((b) => [b.parentElement.textContent.trim(), b.checked]),
      active: document.querySelector(".layout[data-active] .surface-name")?.textContent ?? "",
      figures: [...document.querySelectorAll("#figures tr:first-child td:not([hidden])")].map((c) => c.textContent),
      morph: document.getElementById("morph-value-0")?.textContent ?? "",
      contrast: lowestContrast(),
      overflow: document.documentElement.scrollWidth > window.innerWidth,
    }));
  }
  await context.close();
  return seen;
}

(async () => {
  const browser = await chromium.launch({
    executablePath,
    args: ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"],
  });
  for await (const line of createInterface({ input: process.stdin })) {
    const answer = await visit(browser, JSON.parse(line)).catch((error) => ({ error: String(error) }));
    console.log(JSON.stringify(answer));
  }
  await browser.close();
})();
