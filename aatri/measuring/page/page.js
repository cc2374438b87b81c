"use strict";
/* The page of `aatri measure`: an image of tiles to click into, the points to measure, and where each is in every image.
   Places are px from the outer corner of the upper left pixel, x right, y down, as the server has them. */
(() => {
  const TILE = 256, LARGEST = 64, NEAR = 8, MOST_TILES = 300, POLL_MS = 2000, MOVED_PX = 4;
  const by = id => document.getElementById(id), canvas = by("canvas"), pen = canvas.getContext("2d");
  const state = { version: -1, images: [], points: [], kind: "point", name: "", image: "", seen: null, places: [], undo: [] };
  const view = { zoom: 1, wish: 1, left: 0, top: 0, tiles: new Map(), pointer: null };

  /* ---- asking the server ---- */
  async function ask(path, given) {
    const how = given === undefined ? {} : { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(given) };
    let answer;
    try { answer = await fetch(path, how); } catch { throw new Error("aatri measure has ended: start it again and open its new address"); }
    const told = await answer.json();
    if (!answer.ok) throw new Error(told.error);
    return told;
  }
  const query = given => "?" + new URLSearchParams(given);
  function tell(text, bad = false) { by("message").textContent = text; by("message").className = bad ? "bad" : ""; }
  const trying = work => async (...args) => { try { return await work(...args); } catch (error) { tell(error.message, true); refresh(true); } };

  async function refresh(all = false) {
    try {
      const told = await ask("state" + query({ known: all ? -1 : state.version }));
      if (told.version === state.version && !all) return;
      Object.assign(state, told);
      by("block").textContent = told.block;
      by("run").textContent = told.run;
      document.title = told.block + " - aatri measure";
      lists();
      await Promise.all([seen(), places()]);
    } catch (error) { tell(error.message, true); }
  }
  /* What was under way while this page changed something may be from before it: it is asked for again. */
  let changes = 0;
  async function askLast(path) {
    for (;;) {
      const asked = changes, told = await ask(path);
      if (asked === changes) return told;
    }
  }
  async function seen() {
    const image = state.image;
    if (!image) return;
    const told = await askLast("image" + query({ image }));
    if (image !== state.image) return;
    state.seen = told;
    draw();
  }
  async function places() {
    const { name, kind, image } = state;
    const path = kind === "fiducial" ? image && "marks" + query({ image }) : name && "point" + query({ name });
    const told = path ? (await askLast(path)).places : [];
    if (name !== state.name || kind !== state.kind || kind === "fiducial" && image !== state.image) return;
    state.places = told;
    placesList();
    lists();
    draw();
  }

  /* ---- lists ---- */
  function item(list, name, tells, current, act) {
    const li = list.appendChild(document.createElement("li")), button = li.appendChild(document.createElement("button"));
    button.appendChild(document.createElement("span")).textContent = name;
    const small = button.appendChild(document.createElement("small"));
    for (const [text, how] of tells) { const part = small.appendChild(document.createElement("span")); part.textContent = text; part.className = how || ""; }
    if (current) button.setAttribute("aria-current", "true");
    button.addEventListener("click", act);
    return button;
  }
  function names() {
    const image = state.images.find(i => i.name === state.image);
    if (state.kind === "fiducial") return (image ? image.marks : []).map(name => ({ name, role: "mark", count: row(name) ? 1 : 0 }));
    const text = by("name").value.trim().toLowerCase();
    const all = state.points.some(p => p.name === state.name) || !state.name ? state.points : [{ name: state.name, role: "", count: state.places.filter(p => p.row).length || "new" }, ...state.points];
    return all.filter(p => p.name === state.name || p.name.toLowerCase().includes(text));
  }
  function lists() {
    const list = by("names"), at = list.scrollTop;
    list.textContent = "";
    for (const p of names()) item(list, p.name, [[[p.role, p.count || ""].filter(Boolean).join(" · ")]], p.name === state.name, () => choose(p.name));
    list.scrollTop = at;
    if (!list.children.length) list.appendChild(document.createElement("li")).textContent = state.kind === "fiducial" ? "this camera has no fiducial marks" : "no control or check point is given: write an id above and take it";
    by("image").textContent = "";
    for (const i of state.images) by("image").add(new Option(i.name + (i.count ? ` (${i.count})` : "") + (i.file ? "" : ": no file"), i.name, false, i.name === state.image));
    by("points").setAttribute("aria-pressed", state.kind === "point");
    by("marks").setAttribute("aria-pressed", state.kind === "fiducial");
    by("undo").disabled = !state.undo.length;
  }
  function placesList() {
    const list = by("places");
    list.textContent = "";
    by("chosen").textContent = state.name ? `${state.kind === "point" ? "Point" : "Mark"} ${state.name}` : "Choose a point";
    const measured = state.places.filter(p => p.row).length;
    by("about").textContent = state.kind === "fiducial" ? "Two marks of an image tell where the others are; residuals are from them." : !state.name ? "" : state.places.length > measured ? `measured in ${measured}, to be seen in ${state.places.length} images`
      : `measured in ${measured} image${measured === 1 ? "" : "s"}` + (state.oriented ? "" : "; with a run the page knows where it is in the others");
    for (const p of state.places) {
      const tells = p.row ? p.residual ? [[`${p.residual.map(v => (v < 0 ? "" : "+") + v.toFixed(2)).join(" ")} px`], [p.t === null ? "" : `, t ${p.t.toFixed(1)}`, p.wrong ? "bad" : "good"]] : [["measured"]]
        : [[p.sigma === null ? "somewhere here" : `± ${p.sigma.toFixed(1)} px`]];
      const mark = state.kind === "fiducial";
      item(list, mark ? p.name : p.image, tells, mark ? p.name === state.name : p.image === state.image, mark ? () => choose(p.name) : () => go(p));
    }
  }

  /* ---- choosing ---- */
  const choose = trying(async name => {
    state.name = name;
    lists();
    await places();
    if (name !== state.name) return;
    const here = state.places.find(p => p.image === state.image && (state.kind === "point" || p.name === name));
    if (here) await go(here); else if (state.kind === "point" && state.places.length) await go(state.places[0]);
    canvas.focus();
  });
  const go = trying(async place => {
    await open(place.image, place);
    placesList();
  });
  const open = trying(async (image, place) => {
    if (image !== state.image || !state.seen) {
      state.image = image;
      state.seen = null;
      draw();
      tell(`reading ${image}`);
      await seen();
      if (image !== state.image) return;
      view.tiles.clear();
      tell("");
      if (!place) fit();
      if (state.kind === "fiducial") await places();
      lists();
    }
    if (place) {
      const reach = place.row ? 0 : 4 * (place.sigma || 0);
      view.wish = Math.min(NEAR, Math.max(smallest(), reach ? Math.min(canvas.clientWidth, canvas.clientHeight) / (2 * reach) : NEAR));
      settle();
      middle(place.row ? place.row : place);
    }
  });
  function step(list, now, by_) {
    if (!list.length) return undefined;
    return list[(now + by_ + (now < 0 && by_ < 0 ? 1 : 0) + list.length) % list.length];
  }

  /* ---- changes ---- */
  const row = (name = state.name, kind = state.kind) => state.seen && state.seen.rows.find(r => r.name === name && r.kind === kind);
  /* One change after the other: each takes the row as the one before it left it. */
  let last = Promise.resolve();
  const inTurn = work => (...args) => { last = last.then(() => trying(work)(...args)); return last; };
  function done(told) {
    changes += 1;
    if (state.seen && state.image === told.image) {
      state.seen.rows = state.seen.rows.filter(r => r.name !== told.name || r.kind !== told.kind);
      if (told.row) state.seen.rows.push(told.row);
    }
    draw();
    refresh(true);
  }
  const set = inTurn(async (x, y, snap = false) => write(x, y, snap));
  async function write(x, y, snap) {
    if (!state.name) throw new Error(state.kind === "point" ? "choose a point first, or write an id and take it" : "choose a mark first");
    const image = state.image, name = state.name, kind = state.kind, before = row();
    if (snap) ({ x, y } = await ask("centre", { image, x, y, radius: +by("radius").value || NEAR }));
    const told = await ask("measure", { kind, image, name, before: before ? before.line : "", x, y });
    tell(`${name} in ${image}: x ${told.row.x.toFixed(3)}, y ${told.row.y.toFixed(3)} px from the upper left corner, written`);
    state.undo.push(told.change);
    done(told);
  }
  const remove = inTurn(async () => {
    const old = row();
    if (!old) throw new Error("nothing is measured here");
    const told = await ask("remove", { kind: state.kind, image: state.image, name: state.name, before: old.line });
    tell(`${state.name} in ${state.image}: taken out`);
    state.undo.push(told.change);
    done(told);
  });
  const undo = inTurn(async () => {
    const change = state.undo.pop();
    if (change === undefined) return;
    const told = await ask("undo", { change });
    tell(`${told.name} in ${told.image}: ${told.row ? "as it was before" : "taken out again"}`);
    done(told);
  });

  /* ---- the image ---- */
  const smallest = () => state.seen ? Math.min(1, canvas.clientWidth / state.seen.width, canvas.clientHeight / state.seen.height) / 2 : .01;
  const sharpness = () => devicePixelRatio || 1;
  /* The canvas as it lies on the pixels of the screen: left, top, width, height in them. */
  function frame() {
    const box = canvas.getBoundingClientRect(), s = sharpness(), [left, top] = [Math.round(box.left * s), Math.round(box.top * s)];
    return [left, top, Math.round(box.right * s) - left, Math.round(box.bottom * s) - top];
  }
  const at = event => { const [left, top] = frame(), s = sharpness(); return [event.clientX - left / s, event.clientY - top / s]; };
  /* Move the canvas by less than a pixel so that it begins where one of the screen does. */
  function align() {
    for (const side of ["Left", "Top"]) {
      canvas.style["margin" + side] = "0";
      const begins = canvas.getBoundingClientRect()[side.toLowerCase()], s = sharpness();
      canvas.style["margin" + side] = Math.ceil(begins * s - .01) / s - begins + "px";
    }
    draw();
  }
  /* Enlarged, the pixels of the image end where pixels of the screen do: else they were drawn up to half of one aside. */
  function settle() {
    const s = sharpness();
    if (view.wish * s < 4) { view.zoom = view.wish; return; }
    view.zoom = Math.round(view.wish * s) / s;
  }
  function whole() {
    const step = view.zoom * sharpness();
    if (step >= 4) { view.left = Math.round(view.left * step) / step; view.top = Math.round(view.top * step) / step; }
    draw();
  }
  const toImage = ([u, v]) => [view.left + u / view.zoom, view.top + v / view.zoom];
  function fit() {
    if (!state.seen) return;
    view.wish = Math.min(canvas.clientWidth / state.seen.width, canvas.clientHeight / state.seen.height);
    settle();
    middle({ x: state.seen.width / 2, y: state.seen.height / 2 });
  }
  function middle(place) {
    view.left = place.x - canvas.clientWidth / 2 / view.zoom;
    view.top = place.y - canvas.clientHeight / 2 / view.zoom;
    whole();
  }
  function zoom(factor, about = [canvas.clientWidth / 2, canvas.clientHeight / 2]) {
    const [x, y] = toImage(about);
    view.wish = Math.min(LARGEST, Math.max(smallest(), view.wish * factor));
    settle();
    view.left = x - about[0] / view.zoom;
    view.top = y - about[1] / view.zoom;
    whole();
  }
  function tile(level, column, row) {
    const key = `${state.image}/${level}/${column}/${row}`;
    let picture = view.tiles.get(key);
    if (!picture) {
      picture = new Image();
      picture.addEventListener("load", draw);
      picture.src = "tile" + query({ image: state.image, level, column, row });
      view.tiles.set(key, picture);
      if (view.tiles.size > MOST_TILES) view.tiles.delete(view.tiles.keys().next().value);
    }
    return picture.complete && picture.naturalWidth ? picture : null;
  }
  function tiles(level) {
    const step = 2 ** level, side = TILE * step, { width, height } = state.seen;
    const right = Math.min(width, view.left + canvas.clientWidth / view.zoom), bottom = Math.min(height, view.top + canvas.clientHeight / view.zoom);
    for (let r = Math.max(0, Math.floor(view.top / side)); r * side < bottom; r++)
      for (let c = Math.max(0, Math.floor(view.left / side)); c * side < right; c++) {
        const t = tile(level, c, r);
        if (t) pen.drawImage(t, (c * side - view.left) * view.zoom, (r * side - view.top) * view.zoom, t.naturalWidth * step * view.zoom, t.naturalHeight * step * view.zoom);
      }
  }
  let waiting = false;
  function draw() {
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(() => { waiting = false; drawn(); });
  }
  function drawn() {
    const sharp = sharpness(), [, , w, h] = frame();
    if (canvas.width !== w || canvas.height !== h) { canvas.width = w; canvas.height = h; }
    pen.setTransform(sharp, 0, 0, sharp, 0, 0);
    pen.clearRect(0, 0, w, h);
    if (state.seen) {
      const level = Math.max(0, Math.min(state.seen.levels - 1, Math.floor(Math.log2(1 / (view.zoom * sharp)) + .01)));
      pen.imageSmoothingEnabled = view.zoom < 2;
      if (level < state.seen.levels - 1) tiles(state.seen.levels - 1);
      tiles(level);
      marks();
    }
    if (view.pointer) cursor();
    place();
  }
  function stroke(colour, path, dash = []) {
    for (const [width, style] of [[4, "#0009"], [2, colour]]) {
      pen.lineWidth = width; pen.strokeStyle = style; pen.setLineDash(dash);
      pen.beginPath(); path(); pen.stroke();
    }
    pen.setLineDash([]);
  }
  function cross(u, v, inner, outer) {
    for (const [a, b] of [[1, 0], [-1, 0], [0, 1], [0, -1]]) { pen.moveTo(u + a * inner, v + b * inner); pen.lineTo(u + a * outer, v + b * outer); }
  }
  function label(text, u, v, colour) {
    pen.font = "13px system-ui, sans-serif"; pen.lineWidth = 3; pen.strokeStyle = "#000c"; pen.fillStyle = colour;
    pen.strokeText(text, u, v); pen.fillText(text, u, v);
  }
  const screen = p => [(p.x - view.left) * view.zoom, (p.y - view.top) * view.zoom];
  function marks() {
    for (const p of state.places) {
      if (p.image !== state.image || (p.row && !p.ellipse)) continue;
      const [u, v] = screen(p), chosen = state.kind === "point" || p.name === state.name;
      if (p.ellipse) stroke("#ff6ad5", () => pen.ellipse(u, v, Math.max(3, p.ellipse[0] * view.zoom), Math.max(3, p.ellipse[1] * view.zoom), p.ellipse[2], 0, 2 * Math.PI), [6, 4]);
      if (!p.row && chosen) stroke("#ff6ad5", () => cross(u, v, 6, 14), [3, 3]);
      if (!p.row) label(state.kind === "point" ? state.name : p.name, u + 9, v - 9, "#ff9be4");
    }
    for (const r of state.seen.rows) {
      const chosen = r.name === state.name && r.kind === state.kind, [u, v] = screen(r);
      if (r.of === "tie" && !chosen && !by("ties").checked) continue;
      const colour = chosen ? "#ffe14d" : !r.active ? "#ff8a80" : r.of === "tie" ? "#8fd3ff" : "#6dff9c";
      stroke(colour, () => r.of === "tie" && !chosen ? cross(u, v, 0, 4) : cross(u, v, 3, 13));
      if (r.of !== "tie" || chosen) label(r.name, u + 9, v - 9, colour);
    }
  }
  function cursor() {
    const [u, v] = view.pointer;
    stroke("#fff", () => { cross(u, v, 5, 16); if (by("snap").checked) { const r = (+by("radius").value || NEAR) * view.zoom; pen.moveTo(u + r, v); pen.arc(u, v, r, 0, 2 * Math.PI); } });
  }
  function place() {
    const [x, y] = view.pointer ? toImage(view.pointer) : [NaN, NaN];
    by("place").textContent = state.seen ? `${state.seen.width} × ${state.seen.height} px, zoom ${view.zoom < 1 ? view.zoom.toFixed(3) : view.zoom.toFixed(1)}` + (Number.isNaN(x) ? "" : `, pointer at ${x.toFixed(2)}, ${y.toFixed(2)}`)
      : state.image ? "" : "choose an image, or a point";
  }

  /* ---- pointer and keys ---- */
  let grip = null;
  canvas.addEventListener("pointerdown", e => { if (e.button === 0) { grip = { from: at(e), left: view.left, top: view.top, moved: 0 }; canvas.setPointerCapture(e.pointerId); } });
  canvas.addEventListener("pointermove", e => {
    view.pointer = at(e);
    if (grip) {
      const [u, v] = [view.pointer[0] - grip.from[0], view.pointer[1] - grip.from[1]];
      grip.moved = Math.max(grip.moved, Math.hypot(u, v));
      if (grip.moved > MOVED_PX) { view.left = grip.left - u / view.zoom; view.top = grip.top - v / view.zoom; whole(); }
    }
    draw();
  });
  canvas.addEventListener("pointerup", e => {
    const still = grip && grip.moved <= MOVED_PX;
    grip = null;
    if (still && state.seen) { const [x, y] = toImage(at(e)); set(x, y, by("snap").checked); }
  });
  canvas.addEventListener("pointerleave", () => { view.pointer = null; draw(); });
  canvas.addEventListener("wheel", e => { e.preventDefault(); zoom(Math.exp(-e.deltaY * .002), at(e)); }, { passive: false });
  const refine = inTurn(async () => {
    const r = row();
    if (!r) throw new Error("set the mark first, then bring it to its centre");
    await write(r.x, r.y, true);
  });
  const shift = inTurn(async (dx, dy) => { const r = row(); if (r) await write(r.x + dx, r.y + dy, false); });
  const nudge = (dx, dy) => e => shift(dx * (e.shiftKey ? 1 : .1), dy * (e.shiftKey ? 1 : .1));
  const turn = by_ => () => { const p = step(state.places, state.places.findIndex(q => q.image === state.image), by_); if (p && state.kind === "point") go(p); };
  const next = by_ => () => { const all = names(), p = step(all, all.findIndex(q => q.name === state.name), by_); if (p) choose(p.name); };
  const keys = { ArrowLeft: nudge(-1, 0), ArrowRight: nudge(1, 0), ArrowUp: nudge(0, -1), ArrowDown: nudge(0, 1), n: turn(1), p: turn(-1), j: next(1), k: next(-1),
    r: refine, Delete: remove, Backspace: remove, u: undo, "+": () => zoom(2), "=": () => zoom(2), "-": () => zoom(.5), f: fit, 1: () => zoom(1 / view.wish), 8: () => zoom(8 / view.wish) };
  document.addEventListener("keydown", e => {
    if (/^(INPUT|SELECT)$/.test(e.target.tagName) && e.target.type !== "checkbox") return;
    const act = (e.ctrlKey || e.metaKey) ? (e.key.toLowerCase() === "z" ? undo : null) : keys[e.key.length === 1 ? e.key.toLowerCase() : e.key];
    if (act && !e.altKey) { e.preventDefault(); act(e); }
  });
  const click = { in: () => zoom(2), out: () => zoom(.5), fit, refine, remove, undo };
  for (const [id, act] of Object.entries(click)) by(id).addEventListener("click", act);
  const kind = word => trying(async () => { state.kind = word; state.name = ""; lists(); await places(); });
  by("points").addEventListener("click", kind("point"));
  by("marks").addEventListener("click", kind("fiducial"));
  by("image").addEventListener("change", e => open(e.target.value));
  by("name").addEventListener("input", lists);
  by("ties").addEventListener("change", draw);
  by("add").addEventListener("submit", e => { e.preventDefault(); const name = by("name").value.trim(); by("name").value = ""; if (name) choose(name); });
  addEventListener("resize", align);
  new ResizeObserver(align).observe(by("tools"));
  new ResizeObserver(draw).observe(canvas);
  setInterval(() => { if (!document.hidden) refresh(); }, POLL_MS);
  addEventListener("beforeunload", () => view.tiles.clear());
  refresh(true).then(() => { const first = state.images.find(i => i.file); if (first && !state.image) open(first.name); });
})();
