"use strict";
/* Tables can be sorted, searched and copied; pictures told by the pointer, moved and enlarged, their rays isolated. */
(() => {
  const make = (name, into, properties = {}) => into.appendChild(Object.assign(document.createElement(name), properties));
  const numeric = text => {
    const value = parseFloat(text.replace(/[\u202f,\s]/g, "").replace("−", "-"));
    return Number.isNaN(value) ? -Infinity : value;
  };
  const lengths = { um: 1e-6, mm: 1e-3, m: 1, km: 1e3 };
  const cellValue = text => numeric(text) * (lengths[text.trim().split(/\s/).pop()] || 1);

  function table(t) {
    const body = t.tBodies[0], rows = [...body.rows];
    [...t.querySelectorAll("thead th")].forEach((head, k) => {
      head.dataset.sort = "";
      head.title = "sort";
      head.addEventListener("click", () => {
        const down = head.getAttribute("aria-sort") === "ascending" ? -1 : 1;
        t.querySelectorAll("th").forEach(other => other.removeAttribute("aria-sort"));
        head.setAttribute("aria-sort", down > 0 ? "ascending" : "descending");
        const of = row => row.cells[k].textContent, number = head.classList.contains("n");
        rows.sort((a, b) => down * (number ? cellValue(of(a)) - cellValue(of(b))
          : of(a).localeCompare(of(b), undefined, { numeric: true })));
        body.append(...rows);
      });
    });
    if (rows.length < 8) return;
    const tools = make("div", t.parentElement, { className: "tools" });
    t.parentElement.prepend(tools);
    const search = make("input", tools, { type: "search", placeholder: "search", ariaLabel: "search in the table" });
    search.addEventListener("input", () => rows.forEach(row => {
      row.hidden = ![...row.cells].some(cell => cell.textContent.toLowerCase().includes(search.value.toLowerCase()));
    }));
    const copy = make("button", tools, { textContent: "copy", title: "as text for a spreadsheet" });
    copy.addEventListener("click", () => {
      const lines = [...t.rows].filter(row => !row.hidden).map(row => [...row.cells].map(c => c.textContent).join("\t"));
      const text = lines.join("\n").replace(/\u202f/g, "");
      navigator.clipboard.writeText(text).then(() => { copy.textContent = "copied"; }, () => {
        const area = make("textarea", document.body, { value: text });
        area.select();
        document.execCommand("copy");
        area.remove();
        copy.textContent = "copied";
      });
    });
  }

  /* The places of the marks of a path: every mark begins with an absolute M; corners of areas follow as L. */
  function places(path) {
    const d = path.getAttribute("d"), area = path.dataset.shape === "areas", line = path.dataset.shape === "segments";
    const at = [], corners = [];
    for (const mark of d.split("M").slice(1)) {
      const parts = mark.split("L"), first = parseFloat(parts[0]), second = parseFloat(parts[0].slice(parts[0].indexOf(" ")));
      if (area || line) {
        const points = parts.map(part => part.split(" ").map(parseFloat));
        corners.push(points);
        at.push(points.reduce((s, p) => s + p[0], 0) / points.length, points.reduce((s, p) => s + p[1], 0) / points.length);
      } else at.push(first, second);
    }
    const list = text => text ? text.split("\n") : [];
    const seen = path.dataset.seen === undefined ? null
      : path.dataset.seen.split(";").map(images => images ? images.split(",").map(Number) : []);
    return { path, at: Float32Array.from(at), corners, area, line, ids: list(path.dataset.ids), tells: list(path.dataset.tells), seen,
      sees: path.dataset.sees === "1", n: at.length / 2 };
  }
  const inside = (corners, x, y) => {
    let odd = false;
    for (let i = 0, j = corners.length - 1; i < corners.length; j = i++) {
      const [a, b] = corners[i], [c, e] = corners[j];
      if ((b > y) !== (e > y) && x < (c - a) * (y - b) / (e - b) + a) odd = !odd;
    }
    return odd;
  };

  const grounds = [];  /* plans of the ground: what is isolated in one is isolated in all, by the rays of the block plan */
  function picture(box) {
    const svg = box.querySelector("svg"), group = svg.querySelector(".marks"), many = svg.classList.contains("many");
    const plan = svg.classList.contains("plan"), whole = svg.viewBox.baseVal, width = whole.width, height = whole.height;
    let layers = null, x0 = 0, y0 = 0, scale = 1, tip = null, canvas = null, apart = null, timer = 0, stale = true;
    const read = () => layers ??= [...group.querySelectorAll("path[data-shape]")].map(places);
    const place = event => {
      const r = svg.getBoundingClientRect(), k = width / r.width;
      return [((event.clientX - r.left) * k - x0) / scale, ((event.clientY - r.top) * k - y0) / scale, k / scale];
    };

    function nearest(event) {
      const [x, y, px] = place(event);
      let best = null, least = (9 * px) ** 2;
      for (const layer of read()) {
        if (layer.area || !(layer.ids.length || layer.tells.length)) continue;
        const reach = layer.line ? Math.min(least, (6 * px) ** 2) : least;
        for (let k = 0; k < layer.n; k++) {
          const away = (layer.at[2 * k] - x) ** 2 + (layer.at[2 * k + 1] - y) ** 2;
          if (away < (layer.line ? reach : least)) { least = away; best = [layer, k]; }
        }
      }
      if (best) return best;
      for (const layer of layers) {
        if (!layer.area || !(layer.ids.length || layer.tells.length)) continue;
        const k = layer.corners.findIndex(corners => inside(corners, x, y));
        if (k >= 0) return [layer, k];
      }
      return null;
    }

    svg.addEventListener("pointermove", event => {
      if (event.buttons) return;
      const at = nearest(event);
      if (!at) { tip?.remove(); tip = null; return; }
      tip ??= make("div", box, { className: "tip" });
      tip.textContent = [at[0].ids[at[1]], at[0].tells[at[1]]].filter(Boolean).join("\n");
      const r = box.getBoundingClientRect(), left = event.clientX - r.left;
      tip.style.left = `${Math.min(left + 12, Math.max(0, r.width - tip.offsetWidth))}px`;
      tip.style.top = `${event.clientY - r.top + 14}px`;
    });
    svg.addEventListener("pointerleave", () => { tip?.remove(); tip = null; });
    if (!plan) return;

    const canvasPaths = new Map();
    function paint() {
      if (!many) return;
      stale = false;
      const r = svg.getBoundingClientRect(), ratio = window.devicePixelRatio || 1, k = r.width / width;
      canvas ??= box.insertBefore(document.createElement("canvas"), svg.nextSibling);
      canvas.width = r.width * ratio;
      canvas.height = r.height * ratio;
      canvas.style.width = `${r.width}px`;
      canvas.style.height = `${r.height}px`;
      canvas.style.transform = "";
      canvas.drawn = [x0, y0, scale];
      const c = canvas.getContext("2d");
      for (const layer of read()) {
        const style = getComputedStyle(layer.path), size = parseFloat(style.strokeWidth);
        c.globalAlpha = apart ? 0.12 : 1;
        c.strokeStyle = c.fillStyle = style.stroke;
        c.setTransform(1, 0, 0, 1, 0, 0);
        if (layer.path.classList.contains("dots")) {
          const side = Math.max(size * ratio * k * 0.9, 1.2);
          for (let i = 0; i < layer.n; i++) {
            const x = (layer.at[2 * i] * scale + x0) * k * ratio, y = (layer.at[2 * i + 1] * scale + y0) * k * ratio;
            if (x > -9 && y > -9 && x < canvas.width + 9 && y < canvas.height + 9) c.fillRect(x - side / 2, y - side / 2, side, side);
          }
          continue;
        }
        if (!canvasPaths.has(layer.path)) canvasPaths.set(layer.path, new Path2D(layer.path.getAttribute("d")));
        c.setTransform(k * ratio * scale, 0, 0, k * ratio * scale, x0 * k * ratio, y0 * k * ratio);
        c.lineWidth = size / (k * scale);
        if (layer.path.classList.contains("filled")) {
          c.globalAlpha *= parseFloat(style.fillOpacity);
          c.fill(canvasPaths.get(layer.path));
          c.globalAlpha = apart ? 0.12 : 1;
        }
        if (size > 0) c.stroke(canvasPaths.get(layer.path));
      }
      for (const layer of layers) layer.path.classList.add("canvas");
    }
    function move() {
      x0 = Math.min(0, Math.max(x0, width * (1 - scale)));
      y0 = Math.min(0, Math.max(y0, height * (1 - scale)));
      group.setAttribute("transform", `translate(${x0} ${y0}) scale(${scale})`);
      for (const label of group.querySelectorAll("text")) label.style.fontSize = `${11 / scale}px`;
      for (const label of svg.querySelectorAll(".scale, .key")) {
        label.dataset.text ??= label.textContent;
        const [, number, unit] = label.dataset.text.match(/(\S+) (.*)/), length = parseFloat(number) / scale;
        const smaller = length < 1 && { km: "m", m: "mm", mm: "um" }[unit];
        label.textContent = smaller ? `${+(1000 * length).toPrecision(3)} ${smaller}` : `${+length.toPrecision(3)} ${unit}`;
      }
      if (canvas) {  /* the drawing as it is moves at once; it is drawn anew when the hand rests */
        const [x, y, s] = canvas.drawn, r = svg.getBoundingClientRect().width / width;
        canvas.style.transformOrigin = "0 0";
        canvas.style.transform = `translate(${(x0 - x * scale / s) * r}px, ${(y0 - y * scale / s) * r}px) scale(${scale / s})`;
        clearTimeout(timer);
        timer = setTimeout(paint, 120);
      }
    }
    function zoom(factor, x, y) {
      const next = Math.min(64, Math.max(1, scale * factor));
      x0 += x * (scale - next);
      y0 += y * (scale - next);
      scale = next;
      move();
    }
    const [west, north, left, top, perMetre] = (svg.dataset.at || "").split(" ").map(Number);
    const ground = (x, y) => [west + (x - left) / perMetre, north - (y - top) / perMetre];
    const own = svg.dataset.at && {
      show(rays) {
        if (!rays && !apart) return;
        group.querySelector(".rays")?.remove();
        apart = rays;
        svg.classList.toggle("apart", !!rays);
        if (rays) {
          const path = group.querySelector("path").cloneNode(false);
          for (const name of path.getAttributeNames()) path.removeAttribute(name);
          path.setAttribute("class", "rays");
          const px = (x, y) => `${((x - west) * perMetre + left).toFixed(1)} ${((north - y) * perMetre + top).toFixed(1)}`;
          path.setAttribute("d", rays.map(([a, b, c, e]) => `M${px(a, b)}L${px(c, e)}`).join(""));
          group.append(path);
        }
        const r = svg.getBoundingClientRect();
        if (r.bottom < 0 || r.top > window.innerHeight) stale = true;  /* drawn when it is looked at */
        else paint();
      },
      /* Of an image or point of the block plan, the one of an id that is nearest to a place: rays on the ground, or null. */
      rays(id, [x, y]) {
        const images = read().find(layer => layer.sees), found = [];
        if (!images) return null;
        for (const l of layers) {
          if (l.seen || l.sees) l.ids.forEach((of, k) => {
            if (of === id) { const [a, b] = ground(l.at[2 * k], l.at[2 * k + 1]); found.push([(a - x) ** 2 + (b - y) ** 2, l, k]); }
          });
        }
        if (!found.length) return null;
        const [, layer, k] = found.sort((one, other) => one[0] - other[0])[0], rays = [];
        const ray = (l, i, of) => rays.push([...ground(l.at[2 * i], l.at[2 * i + 1]), ...ground(images.at[2 * of], images.at[2 * of + 1])]);
        if (layer.seen) layer.seen[k].forEach(of => ray(layer, k, of));
        else for (const l of layers) l.seen?.forEach((of, i) => { if (of.includes(k)) ray(l, i, k); });
        return rays;
      },
    };
    if (own) grounds.push(own);
    function isolate(at) {
      let rays = null;
      if (own && at) {
        const [layer, k] = at, place = ground(layer.at[2 * k], layer.at[2 * k + 1]);
        for (const plan of grounds) rays ??= plan.rays(layer.ids[k], place);
      }
      grounds.forEach(plan => plan.show(rays));
      if (rays && tip) tip.textContent += `\n${rays.length} rays drawn`;
    }
    let from = null, moved = false;
    svg.addEventListener("pointerdown", event => { from = [event.clientX, event.clientY, x0, y0]; moved = false; });
    svg.addEventListener("pointermove", event => {
      if (!from || !event.buttons) return;
      const k = width / svg.getBoundingClientRect().width;
      moved ||= Math.hypot(event.clientX - from[0], event.clientY - from[1]) > 4;
      x0 = from[2] + (event.clientX - from[0]) * k;
      y0 = from[3] + (event.clientY - from[1]) * k;
      if (moved) move();
    });
    svg.addEventListener("pointerup", event => {
      from = null;
      if (moved) return;
      isolate(nearest(event));
    });
    svg.addEventListener("wheel", event => {
      if (!event.ctrlKey && scale === 1) return;  /* the page is not caught by its pictures */
      event.preventDefault();
      const [x, y] = place(event);
      zoom(event.deltaY < 0 ? 1.25 : 0.8, x, y);
    }, { passive: false });
    svg.addEventListener("dblclick", event => { const [x, y] = place(event); zoom(2, x, y); });
    const buttons = make("div", box, { className: "zoom" });
    const middle = factor => () => zoom(factor, (width / 2 - x0) / scale, (height / 2 - y0) / scale);
    make("button", buttons, { textContent: "+", title: "larger" }).addEventListener("click", middle(2));
    make("button", buttons, { textContent: "−", title: "smaller" }).addEventListener("click", middle(0.5));
    make("button", buttons, { textContent: "all", title: "the whole" }).addEventListener("click", () => { isolate(null); zoom(0, 0, 0); });
    if (many) {
      new IntersectionObserver(entries => {
        if (stale && entries.some(entry => entry.isIntersecting)) paint();
      }, { rootMargin: "400px" }).observe(box);
      window.addEventListener("resize", () => { clearTimeout(timer); timer = setTimeout(paint, 120); });
      window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", paint);
    }
  }

  document.querySelectorAll("table").forEach(table);
  document.querySelectorAll(".picture").forEach(picture);
  const reveal = () => { const at = location.hash && document.getElementById(decodeURIComponent(location.hash.slice(1)));
    if (at?.tagName === "DETAILS") at.open = true; };
  window.addEventListener("hashchange", reveal);
  reveal();
  window.addEventListener("beforeprint", () => document.querySelectorAll("details.printed").forEach(d => { d.open = true; }));
})();
