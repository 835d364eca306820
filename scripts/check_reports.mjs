// Drives headless Chromium through reports as a phone and as a desktop would, and says what does not work. Not run by CI.
//
//   npm install playwright-core && apt-get install chromium
//   node scripts/check_reports.mjs report/index.html evaluation/index.html
//
// Reports of two frames or more. Node looks for playwright-core from this folder upwards; CHROMIUM names another browser, and
// SHOTS a folder for pictures of what was seen.
import { chromium } from "playwright-core";
import { pathToFileURL } from "node:url";

const browser = await chromium.launch({ executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium", args: ["--no-sandbox", "--disable-gpu"] });
const phone = { viewport: { width: 360, height: 740 }, hasTouch: true, isMobile: true, deviceScaleFactor: 2 };
const desktop = { viewport: { width: 1400, height: 900 } };
let failed = 0, shots = 0, where = "";
const check = (what, holds, found) => { if (!holds) { failed++; console.log(`FAILED ${where}: ${what}`, found ?? ""); } };
const wait = ms => new Promise(done => setTimeout(done, ms));
const shot = page => process.env.SHOTS && page.screenshot({ path: `${process.env.SHOTS}/${String(shots++).padStart(2, "0")}.png` });

async function open(file, device) {
  const context = await browser.newContext(device), page = await context.newPage();
  page.on("pageerror", e => check("script", false, e.message));
  page.on("request", r => check("nothing from elsewhere", /^(file|data|blob):/.test(r.url()), r.url()));
  await page.goto(pathToFileURL(file).href); await wait(500);
  return page;
}
const state = page => page.evaluate(() => ({
  hash: location.hash, zoom: view.zoom, shift: view.shift, scroll: scrollY, name: $("name").textContent, values: $("values").innerText,
  scale: visualViewport.scale, first: document.querySelector(".pane img").src, transforms: [...document.querySelectorAll(".pane :is(img, canvas)")].map(i => i.style.transform),
}));
async function everywhere(page) {
  const found = await page.evaluate(() => ({
    wide: document.documentElement.scrollWidth - innerWidth, viewport: !!document.querySelector("meta[name=viewport]"),
    nameless: [...document.querySelectorAll("button, select, input, [role=img], [role=slider]")]
      .filter(e => !(e.getAttribute("aria-label") || e.labels?.length || e.textContent.trim())).map(e => e.outerHTML),
    silent: [...document.querySelectorAll("img")].filter(i => i.src && !/frame/.test(i.alt)).map(i => i.outerHTML.slice(0, 80)),
    bars: [...document.querySelectorAll(".colours div")].map(d => d.innerText).filter(t => !/\d/.test(t)).length,
  }));
  check("the page does not scroll sideways", found.wide <= 0, found.wide);
  check("viewport", found.viewport);
  check("controls have names", !found.nameless.length, found.nameless);
  check("pictures have texts", !found.silent.length, found.silent);
  check("colour bars have numbers", found.bars === 0);
}
async function reloads(page) {
  await wait(300);
  const before = await state(page);
  await page.reload(); await wait(700);
  const after = await state(page);
  for (const key of ["hash", "name", "values", "first"]) check(`a reload keeps ${key}`, before[key] === after[key], [before[key], after[key]]);
  const at = s => [s.zoom, ...s.shift];
  check("a reload keeps where the pictures are", at(after).every((x, i) => Math.abs(x - at(before)[i]) < 0.01), [at(before), at(after)]);
}

async function touch(file) {
  where = `${file}, phone`;
  const page = await open(file, phone), client = await page.context().newCDPSession(page);
  const send = (type, points) => client.send("Input.dispatchTouchEvent", { type, touchPoints: points.map(([x, y], id) => ({ x, y, id })) });
  const gesture = async (from, to) => {
    await send("touchStart", from);
    for (let t = 1; t <= 10; t++) { await send("touchMove", from.map((p, i) => p.map((c, k) => c + (to[i][k] - c) * t / 10))); await wait(16); }
    await send("touchEnd", []); await wait(400);
  };
  await everywhere(page);
  await page.evaluate(() => document.querySelector(".pane").scrollIntoView({ block: "center" }));
  const middle = async () => { const b = await page.locator(".pane").first().boundingBox(); return [b.x + b.width / 3, b.y + b.height / 2]; };
  let [x, y] = await middle(), before = await state(page), after;
  await gesture([[x, y + 60]], [[x, y - 60]]);
  after = await state(page);
  check("a swipe over a picture scrolls the page", after.scroll > before.scroll + 50 && after.zoom === 1, [before.scroll, after.scroll]);
  [x, y] = await middle();
  await gesture([[x - 20, y], [x + 20, y]], [[x - 70, y], [x + 70, y]]);
  before = after; after = await state(page);
  check("a pinch zooms the pictures, not the page", after.zoom > 2 && after.scale === 1 && after.scroll === before.scroll, after);
  check("all pictures alike", after.transforms.every(t => t.includes(`scale(${after.zoom})`)), after.transforms);
  await gesture([[x, y]], [[x - 60, y - 30]]);
  before = after; after = await state(page);
  check("a swipe moves what is zoomed", after.shift.every((s, i) => s < before.shift[i]) && after.scroll === before.scroll, [before, after]);
  await page.touchscreen.tap(x, y); await wait(500);
  after = await state(page);
  check("a tap tells values", /pixel \d+, \d+/.test(after.values) && /\d+\s+\d+\s+\d+/.test(after.values), after.values);
  await shot(page); await reloads(page); await page.context().close();
}

async function keyboard(file) {
  where = `${file}, desktop`;
  const page = await open(file, desktop), key = (...keys) => keys.reduce((last, k) => last.then(() => page.keyboard.press(k)), Promise.resolve());
  await everywhere(page);
  const first = (await state(page)).name, named = async (what, other) => check(what, (await state(page)).name !== first === other);
  await key("ArrowRight"); await named("an arrow steps", true);
  await key("ArrowLeft"); await named("and back", false);
  await page.focus("#next"); await key("Space"); await named("Space presses a focused button", true);
  await page.focus("#back"); await key("Enter"); await named("so does Enter", false);
  check("focus is seen", await page.evaluate(() => getComputedStyle(document.activeElement).outlineStyle === "solid"));
  await key("+", "+"); check("+ zooms", (await state(page)).zoom > 1.5);
  await key("-", "-"); check("- zooms out", Math.abs((await state(page)).zoom - 1) < 1e-6);
  await key("Control++"); check("not with Ctrl", (await state(page)).zoom === 1);
  await page.focus("#metric"); await key("+"); check("not in a list", (await state(page)).zoom === 1);
  await page.evaluate(() => document.activeElement.blur());
  const { first: shown } = await state(page);
  await page.keyboard.down("r"); check("r held shows the reference", (await state(page)).first !== shown);
  await page.keyboard.up("r"); check("r let go", (await state(page)).first === shown);
  const pressed = () => page.evaluate(() => $("play").getAttribute("aria-pressed"));
  const heights = () => page.evaluate(() => JSON.stringify([...document.querySelectorAll(".pane, .bar, #plot")].map(e => e.getBoundingClientRect()).map(r => [r.left, r.top, r.width, r.height])));
  const still = await heights(), names = new Set();
  await key("Space"); check("Space plays", await pressed() === "true");
  for (let i = 0; i < 30; i++) { await wait(50); names.add((await state(page)).name); }
  check("every frame is played", names.size >= Math.min(4, await page.evaluate(() => 1 + +$("slide").max)), [...names]);
  check("nothing moves but the pictures", await heights() === still, [still, await heights()]);
  await key("Space"); check("Space again stops", await pressed() === "false");
  const { name: stopped } = await state(page); await wait(300);
  check("and stays", (await state(page)).name === stopped);
  await key("ArrowRight", "+", "+", "+", "Shift+ArrowRight");
  const pane = page.locator(".pane").first();
  await pane.hover({ position: { x: 90, y: 50 } }); await wait(400);
  const { values } = await state(page);
  check("values below the pointer", /pixel \d+, \d+/.test(values) && /\d+\s+\d+\s+\d+/.test(values), values);
  await pane.click({ position: { x: 90, y: 50 } });
  await page.mouse.move(5, 5); await shot(page); await reloads(page); await page.context().close();
}

for (const file of process.argv.slice(2)) { await touch(file); await keyboard(file); }
console.log(failed ? `${failed} failed` : "all as it should be");
await browser.close();
process.exit(failed ? 1 : 0);
