/* Opens a page in headless chromium, does what a user does, takes a screenshot after every step, and prints
   what it saw as JSON. Called by test_browser.py: node drive.cjs CHROMIUM PAGE FOLDER WIDTH HEIGHT TOUCH STEPS */

const { chromium } = require("playwright-core");

const [executablePath, page, folder, width, height, touch, steps] = process.argv.slice(2);

async function pinch(session, x, y) {
  const points = (gap) => [{ x: x - gap, y, id: 1 }, { x: x + gap, y, id: 2 }];
  const send = (type, touchPoints) => session.send("Input.dispatchTouchEvent", { type, touchPoints });
  await send("touchStart", points(20));
  for (const gap of [30, 40, 50, 60]) await send("touchMove", points(gap));
  await send("touchEnd", []);
}

async function swipe(session, x, y) {
  const send = (type, touchPoints) => session.send("Input.dispatchTouchEvent", { type, touchPoints });
  await send("touchStart", [{ x, y, id: 1 }]);
  for (let k = 1; k <= 4; k++) await send("touchMove", [{ x: x + 20 * k, y: y + 6 * k, id: 1 }]);
  await send("touchEnd", []);
}

(async () => {
  const browser = await chromium.launch({
    executablePath,
    args: ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"],
  });
  const context = await browser.newContext({
    viewport: { width: Number(width), height: Number(height) }, hasTouch: touch === "yes",
  });
  const tab = await context.newPage();
  const seen = { console: [], requests: [], shots: {}, text: {} };
  tab.on("console", (m) => ["error", "warning"].includes(m.type()) && seen.console.push(m.text()));
  tab.on("pageerror", (e) => seen.console.push(e.message));
  tab.on("request", (r) => r.url().startsWith("data:") || seen.requests.push(r.url()));
  await tab.goto(page);
  await tab.waitForSelector("body[data-ready=yes], table.sortable", { timeout: 120000 });
  seen.marks = await tab.evaluate(() => performance.getEntriesByType("mark").map((m) => [m.name, m.startTime]));
  for (const name of ["surface", "plane"]) seen[name] = await tab.locator(`#${name}`).boundingBox({ timeout: 500 }).catch(() => null);
  const session = await context.newCDPSession(tab);
  for (const [name, action, ...rest] of JSON.parse(steps)) {
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
    if (action === "swipe") await swipe(session, ...rest);
    if (action === "click") await tab.click(rest[0]);
    if (action === "key") await tab.press(rest[0], rest[1]);
    if (action === "fill") await tab.locator(rest[0]).fill(rest[1]);
    await tab.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))));
    seen.shots[name] = `${folder}/${name}.png`;
    await tab.screenshot({ path: seen.shots[name], fullPage: action === "full" });
    seen.text[name] = await tab.evaluate(() => ({
      hovered: document.getElementById("hovered")?.textContent ?? "",
      first: document.querySelector("table.sortable tbody th")?.textContent ?? "",
      overflow: document.documentElement.scrollWidth > window.innerWidth,
    }));
  }
  console.log(JSON.stringify(seen));
  await browser.close();
})();
