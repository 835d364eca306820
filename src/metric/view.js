// What both reports share: pictures that zoom and move together, the pixel under the pointer, keys, and the choice in the address.
const $ = id => document.getElementById(id);
const element = (tag, text, cls) => { const e = document.createElement(tag); if (text !== undefined) e.textContent = text; if (cls) e.className = cls; return e; };
const within = (x, low, high) => Math.max(low, Math.min(high, x));

// `zoom` and `shift` (in widths and heights of a picture) are those of all pictures, `cut` is where the knife divides the first.
const view = { zoom: 1, shift: [0, 0], cut: 0.5, hovered: null, picked: null };
const pixel = () => view.hovered ?? view.picked;

// Links `panes`, whose pictures have `size()` pixels. `changed` hears of what the address should keep, `pointed` of another pixel.
function link(panes, size, knife, changed, pointed) {
  const marks = panes.map(p => p.appendChild(element("div", "", "mark"))), over = panes[0].querySelector(".top");
  function place() {
    const [n, m] = size(), at = pixel(), { zoom, shift } = view;
    panes.forEach((p, i) => {
      const w = p.clientWidth, h = p.clientHeight, mark = marks[i];
      for (const im of p.querySelectorAll("img, canvas")) im.style.transform = `translate(${shift[0] * w}px, ${shift[1] * h}px) scale(${zoom})`;
      p.classList.toggle("pixels", zoom * w > n);
      p.classList.toggle("zoomed", zoom > 1);
      mark.hidden = !at;
      if (at) Object.assign(mark.style, { left: (shift[0] + zoom * at[0] / n) * w + "px", top: (shift[1] + zoom * at[1] / m) * h + "px", width: zoom * w / n + "px", height: zoom * h / m + "px" });
    });
    over.style.clipPath = `inset(0 0 0 ${view.cut * 100}%)`;
    knife.style.left = view.cut * 100 + "%";
    knife.setAttribute("aria-valuenow", Math.round(view.cut * 100));
    $("values").classList.toggle("some", !!at);
    $("values").classList.toggle("picked", !!view.picked);
  }
  // What lay at `from` comes to lie at `to`; the picture never leaves its frame.
  function zoomTo(zoom, from = [0.5, 0.5], to = from) {
    zoom = within(zoom, 1, 40);
    view.shift = view.shift.map((s, i) => within(to[i] - (from[i] - s) * zoom / view.zoom, 1 - zoom, 0));
    view.zoom = zoom;
    place(); changed();
  }
  const move = (x, y) => zoomTo(view.zoom, [0.5, 0.5], [0.5 + x, 0.5 + y]);
  const divide = cut => { view.cut = within(cut, 0, 1); place(); changed(); };
  const point = (kind, at) => { view[kind] = at; place(); pointed(); };

  for (const p of panes) {
    const held = new Map();
    let moved = 0;
    const spot = (x, y) => { const r = p.getBoundingClientRect(); return [(x - r.left) / r.width, (y - r.top) / r.height]; };
    const under = e => spot(e.clientX, e.clientY).map((c, i) => within(Math.floor((c - view.shift[i]) / view.zoom * size()[i]), 0, size()[i] - 1));
    // Middle and spread of one finger or two: a drag is a pinch whose spread stays.
    const grip = () => {
      const [[x, y], [u, v]] = held.size > 1 ? [...held.values()] : [...held.values(), ...held.values()];
      return { middle: spot((x + u) / 2, (y + v) / 2), spread: Math.hypot(x - u, y - v) || 1 };
    };
    p.addEventListener("wheel", e => {
      e.preventDefault();
      // A pinch on a touchpad comes as small steps of the wheel with Ctrl.
      zoomTo(view.zoom * Math.exp(-e.deltaY * (e.ctrlKey ? 0.01 : 0.0015)), spot(e.clientX, e.clientY));
    }, { passive: false });
    p.addEventListener("pointerdown", e => {
      if (held.size > 1 || e.button) return;
      if (!held.size) moved = 0;
      held.set(e.pointerId, [e.clientX, e.clientY]);
      p.setPointerCapture(e.pointerId);
    });
    p.addEventListener("pointermove", e => {
      if (held.has(e.pointerId)) {
        const before = grip(), [x, y] = held.get(e.pointerId);
        moved += Math.hypot(e.clientX - x, e.clientY - y);
        held.set(e.pointerId, [e.clientX, e.clientY]);
        const after = grip();
        zoomTo(view.zoom * after.spread / before.spread, before.middle, after.middle);
      }
      if (e.pointerType !== "touch") point("hovered", under(e));
    });
    for (const end of ["pointerup", "pointercancel"]) p.addEventListener(end, e => held.delete(e.pointerId));
    p.addEventListener("pointerleave", () => point("hovered", null));
    // A tap or a click keeps the pixel, the same again lets it go.
    p.addEventListener("click", e => {
      if (moved > 5 || e.target === knife) return;
      const at = view.hovered ?? under(e);
      point("picked", String(at) === String(view.picked) ? null : at); changed();
    });
  }
  knife.addEventListener("pointerdown", e => { e.stopPropagation(); knife.setPointerCapture(e.pointerId); });
  knife.addEventListener("pointermove", e => {
    e.stopPropagation();
    const r = panes[0].getBoundingClientRect();
    if (knife.hasPointerCapture(e.pointerId)) divide((e.clientX - r.left) / r.width);
  });
  knife.addEventListener("keydown", e => { const d = { ArrowLeft: -0.02, ArrowRight: 0.02 }[e.key]; if (d) { divide(view.cut + d); e.preventDefault(); } });
  return { place, zoomTo, move, fit: () => zoomTo(1) };
}

// The keys of a page. None while something is typed or with Ctrl, the browser's own zoom; Space on a focused button presses it, and else
// plays, where there is something to play.
function listen(linked, step, peek) {
  const arrows = { ArrowLeft: [1, 0], ArrowRight: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
  const action = e => {
    const on = choice => e.target.matches?.(choice), arrow = arrows[e.key];
    if (e.ctrlKey || e.metaKey || e.altKey || on("select, textarea, input:not([type=range])")) return;
    if (arrow && on("input, .knife, .scroll")) return;
    if (arrow && e.shiftKey) return () => linked.move(arrow[0] * 0.1, arrow[1] * 0.1);
    if (arrow?.[0]) return () => step(-arrow[0]);
    if (e.key === "+" || e.key === "=") return () => linked.zoomTo(view.zoom * 1.25);
    if (e.key === "-") return () => linked.zoomTo(view.zoom / 1.25);
    if (e.key === "0") return linked.fit;
    if (e.key === "p" || (e.key === " " && !on("button"))) return $("play").hidden ? undefined : () => { if (!e.repeat) $("play").click(); };
    if (e.key === "r") return () => { if (!e.repeat) peek(true); };
  };
  addEventListener("keydown", e => { const act = action(e); if (act) { e.preventDefault(); act(); } });
  addEventListener("keyup", e => { if (e.key === "r") peek(false); });
  addEventListener("blur", () => peek(false));
}

// The walk as a film: `onward()` shows the next frame, and after the last the first; it may say when all of that is there. The next
// follows after `period()` milliseconds, or as soon as the pictures have come. `paused` hears of the end.
function film(count, images, onward, period = () => 1000 / 12, paused = () => {}) {
  const play = $("play"), reel = { playing: false };
  let round = 0;
  play.hidden = count < 2;
  const run = async () => {
    const mine = ++round;
    while (mine === round) {
      const due = performance.now() + period();
      await onward();
      await Promise.all(images.map(image => image.decode().catch(() => {})));
      await new Promise(done => setTimeout(done, Math.max(0, due - performance.now())));
    }
  };
  play.onclick = () => {
    reel.playing = !reel.playing;
    play.setAttribute("aria-pressed", reel.playing);
    play.textContent = reel.playing ? "pause" : "play";
    if (reel.playing) run(); else { round++; paused(); }
  };
  return reel;
}

// The choice in the address, so that a reload or a link shows the same: `chosen()` tells it, `choose` takes it. Browsers refuse
// an address that changes all the time, hence the wait.
function address(chosen, choose) {
  let waiting;
  const pair = p => p && p.join("_"), numbers = text => { const n = (text ?? "").split("_").map(Number); return n.length > 1 && n.every(Number.isFinite) ? n : null; };
  const write = () => {
    const { zoom, shift, cut, picked } = view;
    const centre = zoom > 1 ? [zoom, ...shift.map(s => (0.5 - s) / zoom)].map(x => +x.toFixed(4)) : null;
    const all = { ...chosen(), cut: cut === 0.5 ? null : cut.toFixed(3), zoom: pair(centre), pixel: pair(picked) };
    const text = new URLSearchParams(Object.entries(all).filter(([, v]) => v !== null && v !== undefined)).toString();
    if (text !== location.hash.slice(1)) history.replaceState(null, "", "#" + text);
  };
  const read = () => {
    const text = new URLSearchParams(location.hash.slice(1)), [zoom, x, y] = numbers(text.get("zoom")) ?? [1, 0.5, 0.5];
    view.zoom = within(zoom, 1, 40);
    view.shift = [x, y].map(c => within(0.5 - c * view.zoom, 1 - view.zoom, 0) || 0);
    view.cut = within(Number(text.get("cut") ?? 0.5) || 0, 0, 1);
    view.picked = numbers(text.get("pixel"))?.map(c => Math.max(0, Math.floor(c))) ?? null;
    choose(text);
  };
  addEventListener("hashchange", read);
  addEventListener("pagehide", write);
  return { read, changed: () => { clearTimeout(waiting); waiting = setTimeout(write, 200); } };
}

// Red, green and blue of one pixel, 0 to 255. A browser lets a page read pictures from data: addresses alone.
const brush = Object.assign(document.createElement("canvas"), { width: 1, height: 1 }).getContext("2d", { willReadFrequently: true });
function bytes(image, x, y) {
  if (!image.naturalWidth) return null;
  brush.drawImage(image, -x, -y);
  return [...brush.getImageData(0, 0, 1, 1).data].slice(0, 3);
}

// Rows of cells, the first of each and the first row as heads.
function grid(rows) {
  const t = element("table");
  rows.forEach((cells, i) => { const r = element("tr"); cells.forEach((c, j) => r.append(element(i && j ? "td" : "th", c))); t.append(r); });
  return t;
}

// A colour bar and the numbers along it.
function colourBar(colours, numbers) {
  const box = element("div", undefined, "colours"), strip = element("i"), line = element("div");
  strip.style.background = `linear-gradient(90deg, ${colours.join(", ")})`;
  line.append(...numbers.map((n, i) => { const s = element("span", n); s.style.left = 100 * i / (numbers.length - 1) + "%"; return s; }));
  box.setAttribute("role", "img"); box.setAttribute("aria-label", "colour bar: " + numbers.join(", "));
  box.append(strip, line);
  return box;
}
