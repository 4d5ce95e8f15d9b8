/* The examiner's cursor: which image is selected, and all that moves with it, without asking the server. */
(function () {
  "use strict";
  const SETTLE_MS = 120, BEHIND_M = 30, CAR_M = 4.5, SPAN_M = { auto: 0, 50: 50, 100: 100, 200: 200, 500: 500 };
  const FONT = { family: "system-ui, sans-serif", size: 12 };
  const AXIS = { zeroline: false, gridcolor: "#dddddd", linecolor: "#444444" };
  const state = { k: 0, playing: false, speed: 1, frame: "vehicle", span: "auto", view: {}, wanted: null };
  let head = null, col = {}, els = {}, drawn = false, pending = false, lastTick = 0, settle = 0;
  const drawTimes = [];

  // ---- the drive -------------------------------------------------------------------------------------
  async function load() {
    const answer = await fetch("/drive.bin");
    if (!answer.ok) { say("the drive could not be loaded: " + answer.status); return; }
    const bytes = await answer.arrayBuffer();
    const length = new DataView(bytes).getUint32(0, true);
    head = JSON.parse(new TextDecoder().decode(new Uint8Array(bytes, 4, length)));
    let at = 4 + length;
    for (const [name, count] of Object.entries(head.columns)) {
      col[name] = new Float32Array(bytes, at, count);
      at += 4 * count;
    }
    start();
  }

  function say(text) { const box = document.getElementById("said"); if (box) box.textContent = text; }
  function nearest(t) {
    let low = 0, high = head.images - 1;
    while (low < high) { const mid = (low + high) >> 1; if (col.t[mid] < t) low = mid + 1; else high = mid; }
    return low > 0 && t - col.t[low - 1] < col.t[low] - t ? low - 1 : low;
  }
  function number(value, digits, unit) { return Number.isFinite(value) ? value.toFixed(digits) + unit : "-"; }
  function clock(t) {
    const m = Math.floor(t / 60), s = (t - 60 * m).toFixed(2).padStart(5, "0");
    return m >= 60 ? `${Math.floor(m / 60)}:${String(m % 60).padStart(2, "0")}:${s}` : `${m}:${s}`;
  }

  // ---- the drive from above ---------------------------------------------------------------------------
  function pose() {
    const k = state.k;
    return { x: col.x[k], y: col.y[k], cos: Math.cos(col.yaw[k]), sin: Math.sin(col.yaw[k]) };
  }
  function placed(p, xs, ys) {
    if (state.frame === "world") return { x: xs, y: ys };
    const ahead = [], left = [];
    for (let i = 0; i < xs.length; i++) {
      const e = xs[i] - p.x, n = ys[i] - p.y;
      ahead.push(e * p.cos + n * p.sin); left.push(n * p.cos - e * p.sin);
    }
    return { x: ahead, y: left };
  }
  function fromVehicle(p, ahead, left) {
    if (state.frame !== "world") return { x: ahead, y: left };
    return {
      x: ahead.map((a, i) => p.x + a * p.cos - left[i] * p.sin),
      y: ahead.map((a, i) => p.y + a * p.sin + left[i] * p.cos),
    };
  }
  function reach() {
    if (state.span !== "auto") return SPAN_M[state.span];
    const far = Math.max(0, ...head.sides.map((side) => col[side + ".x_max"][state.k] || 0));
    return Math.min(250, Math.max(40, Math.ceil((far || 80) / 20) * 20 + 20));
  }
  function polynomial(side, x) {
    const k = state.k, c = (n) => col[`${side}.c${n}`][k];
    return c(0) + x * (c(1) + x * (c(2) + x * c(3)));
  }
  function aboveTraces(ahead_m) {
    const p = pose(), traces = [], k = state.k;
    let first = k, last = k;
    while (first > 0 && Math.hypot(col.x[first] - p.x, col.y[first] - p.y) < BEHIND_M + ahead_m * 0.2 && k - first < 3000) first--;
    while (last < head.images - 1 && Math.hypot(col.x[last] - p.x, col.y[last] - p.y) < ahead_m && last - k < 3000) last++;
    traces.push({ ...placed(p, Array.from(col.x.slice(first, last + 1)), Array.from(col.y.slice(first, last + 1))),
      mode: "lines", name: "trajectory", line: { color: "#666666", dash: "dash", width: 1.5 }, hoverinfo: "skip" });
    head.sides.forEach((side, i) => {
      const place = col[side + ".place"][k], step = head.spacing[side] || 0.5;
      const from = Math.max(0, Math.floor(place - BEHIND_M / step)), to = Math.ceil(place + ahead_m / step) + 1;
      const known = Number.isFinite(place);
      traces.push({ ...placed(p, known ? Array.from(col[side + ".ref_x"].slice(from, to)) : [], known ? Array.from(col[side + ".ref_y"].slice(from, to)) : []),
        mode: "lines", name: "reference", legendgroup: "reference", showlegend: i === 0, connectgaps: false,
        line: { color: "#000000", width: 1.5 }, hoverinfo: "skip" });
    });
    const at_m = Number(state.view.range);
    head.sides.forEach((side) => {
      const far = col[side + ".x_max"][k], there = Number.isFinite(col[side + ".c0"][k]);
      const end = Number.isFinite(far) ? far : ahead_m, xs = [], ys = [];
      for (let i = 0; there && i <= 40; i++) { const x = (end * i) / 40; xs.push(x); ys.push(polynomial(side, x)); }
      const predicted = there && !col[side + ".measured"][k];
      traces.push({ ...fromVehicle(p, xs, ys), mode: "lines", name: side + " reported",
        line: { color: head.colours[side], width: 3, dash: predicted ? "dot" : "solid" }, hoverinfo: "name" });
      const marked = there && at_m <= end ? [at_m] : [];
      traces.push({ ...fromVehicle(p, marked, marked.map((x) => polynomial(side, x))), mode: "markers", showlegend: false,
        name: side, marker: { color: head.colours[side], size: 9, symbol: "circle-open", line: { width: 2 } }, hoverinfo: "name" });
    });
    traces.push({ ...fromVehicle(p, [-CAR_M / 4, CAR_M * 0.75, -CAR_M / 4, -CAR_M / 4], [0.9, 0, -0.9, 0.9]), mode: "lines", fill: "toself",
      fillcolor: "#009e73", line: { color: "#009e73", width: 1 }, name: "vehicle", showlegend: false, hoverinfo: "skip" });
    return traces;
  }
  function aboveLayout(ahead_m) {
    const world = state.frame === "world", p = pose();
    const mid = [p.x + p.cos * ahead_m * 0.4, p.y + p.sin * ahead_m * 0.4], half = ahead_m * 0.7;
    const half_m = Math.max(6, Math.min(12, ahead_m / 10));
    return {
      margin: { l: 56, r: 10, t: 30, b: 38 }, font: FONT, showlegend: true, uirevision: `${state.frame} ${state.span}`,
      legend: { orientation: "h", x: 0, y: 1.0, yanchor: "bottom", font: { size: 10 } },
      xaxis: { ...AXIS, title: { text: world ? "x (m)" : "ahead (m)", standoff: 4 },
        range: world ? [mid[0] - half, mid[0] + half] : [-BEHIND_M * 0.5, ahead_m] },
      yaxis: { ...AXIS, title: { text: world ? "y (m)" : "left (m)", standoff: 4 },
        range: world ? [mid[1] - half, mid[1] + half] : [-half_m, half_m], ...(world ? { scaleanchor: "x" } : {}) },
    };
  }
  function drawOverview() {
    const step = Math.max(1, Math.floor(head.images / 3000)), x = [], y = [], numbers = [];
    for (let k = 0; k < head.images; k += step) { x.push(col.x[k]); y.push(col.y[k]); numbers.push(k); }
    const changes = head.lane_changes.map((c) => c.number);
    Plotly.newPlot(els.overview, [
      { x, y, customdata: numbers, mode: "lines", name: "drive", line: { color: "#666666", width: 2 }, hovertemplate: "image %{customdata}<extra></extra>" },
      { x: changes.map((k) => col.x[k]), y: changes.map((k) => col.y[k]), customdata: changes, mode: "markers", name: "lane change",
        marker: { symbol: "diamond", color: "#e69f00", size: 8 }, hovertemplate: "lane change, image %{customdata}<extra></extra>" },
    ], {
      margin: { l: 56, r: 10, t: 26, b: 38 }, font: FONT, hovermode: "closest", legend: { orientation: "h", x: 0, y: 1, yanchor: "bottom", font: { size: 10 } },
      xaxis: { ...AXIS, title: { text: "x (m), the whole drive", standoff: 4 } }, yaxis: { ...AXIS, title: { text: "y (m)", standoff: 4 }, scaleanchor: "x" },
    }, { displaylogo: false, responsive: true });
    els.overview.on("plotly_afterplot", here);
    els.overview.on("plotly_click", (event) => { const k = event.points[0].customdata; if (k !== undefined) go(k); });
  }
  function draw() {
    pending = false;
    const began = performance.now(), ahead_m = reach(), k = state.k;
    Plotly.react(els.above, aboveTraces(ahead_m), aboveLayout(ahead_m), { displaylogo: false, responsive: true });
    cursors();
    panel();
    els.slider.value = k;
    els.clock.textContent = `${clock(col.t[k])}  image ${k}`;
    drawTimes.push(performance.now() - began);
    window.vsensorExamine.shown = k;
  }
  function go(k) {
    if (!head) return;
    state.k = Math.max(0, Math.min(head.images - 1, Math.round(k)));
    if (!pending) { pending = true; requestAnimationFrame(draw); }
    clearTimeout(settle);
    settle = setTimeout(settled, SETTLE_MS);
  }

  function settled() {
    if (state.view.function === "over_range") dash_clientside.set_props("cursor", { data: state.k });
    remember();
  }

  // ---- cursors over the plots of the server, information ----------------------------------------------
  function line(id, x) {
    const graph = document.querySelector(`#${id} .js-plotly-plot`);
    if (!graph || !graph._fullLayout || !graph._fullLayout.xaxis) return;
    let bar = document.querySelector(`#${id} > .cursor`);
    if (!bar) { bar = document.createElement("div"); bar.className = "cursor"; document.getElementById(id).appendChild(bar); }
    const axis = graph._fullLayout.xaxis, up = graph._fullLayout.yaxis, at = axis.l2p(x);
    const inside = Number.isFinite(at) && at >= 0 && at <= axis._length;
    bar.style.display = inside ? "block" : "none";
    bar.style.left = axis._offset + at - 1 + "px"; bar.style.top = up._offset + "px"; bar.style.height = up._length + "px";
    if (!graph.vsensorTold) { graph.vsensorTold = true; graph.on("plotly_afterplot", cursors); }
  }
  function here() {
    const layout = els.overview._fullLayout, k = state.k;
    if (!layout || !layout.xaxis) return;
    if (!els.here) { els.here = document.createElement("div"); els.here.className = "here"; els.here.title = "here"; }
    if (els.here.parentNode !== els.overview) els.overview.appendChild(els.here);
    const x = layout.xaxis.l2p(col.x[k]), y = layout.yaxis.l2p(col.y[k]);
    const inside = x >= 0 && x <= layout.xaxis._length && y >= 0 && y <= layout.yaxis._length;
    els.here.style.display = inside ? "block" : "none";
    els.here.style.left = layout.xaxis._offset + x - 7 + "px"; els.here.style.top = layout.yaxis._offset + y - 7 + "px";
  }
  function cursors() {
    if (!head) return;
    here();
    const t = col.t[state.k], rate = (col.yaw_rate[state.k] * 180) / Math.PI;
    line("analysis", state.view.function === "over_range" ? Number(state.view.range) : state.view.sort === "time" ? t : rate);
    line("quality", t);
  }
  function rows(pairs) {
    const table = document.createElement("table");
    for (const [name, value] of pairs) {
      const row = table.insertRow(); row.insertCell().textContent = name; row.insertCell().textContent = value;
    }
    return table;
  }
  function panel() {
    const k = state.k, deg = 180 / Math.PI;
    const now = [["time", clock(col.t[k])], ["image", `${k} of ${head.images}`], ["speed", number(col.speed[k] * 3.6, 1, " km/h")],
      ["yaw rate", number(col.yaw_rate[k] * deg, 2, " deg/s")], ["road width", number(col.width[k], 2, " m")]];
    for (const side of head.sides)
      now.push([side, col[side + ".quality"][k] ? `${number(col[side + ".c0"][k], 2, " m")}, to ${number(col[side + ".x_max"][k], 0, " m")}, quality ${col[side + ".quality"][k]}` : "not reported"]);
    els.now.replaceChildren(rows(now));
  }
  function panels() {
    const box = document.getElementById("panel");
    els.now = document.createElement("div"); els.now.id = "now";
    const whole = document.createElement("div"); whole.id = "totals"; whole.appendChild(rows(head.totals));
    for (const text of head.notes) { const p = document.createElement("p"); p.textContent = text; whole.appendChild(p); }
    const changes = document.createElement("div"); changes.id = "changes";
    const title = document.createElement("h2"); title.textContent = `${head.lane_changes.length} lane changes`; changes.appendChild(title);
    for (const change of head.lane_changes) {
      const button = document.createElement("button"); button.textContent = change.text; button.onclick = () => go(change.number);
      changes.appendChild(button);
    }
    box.replaceChildren(els.now, whole, changes);
  }

  // ---- slider, keys, tools ----------------------------------------------------------------------------
  function select(options, value, title, chosen) {
    const box = document.createElement("select"); box.title = title;
    for (const [key, text] of options) { const o = document.createElement("option"); o.value = key; o.textContent = text; box.appendChild(o); }
    box.value = value; box.onchange = () => { chosen(box.value); box.blur(); };
    return box;
  }
  function button(id, text, title, pressed) {
    const made = document.createElement("button"); made.id = id; made.textContent = text; made.title = title;
    made.onclick = () => { pressed(); made.blur(); };
    return made;
  }
  function play(on) {
    state.playing = on; els.play.textContent = on ? "pause" : "play"; lastTick = performance.now();
    if (on) { if (state.k >= head.images - 1) go(0); state.t = col.t[state.k]; requestAnimationFrame(step); }
  }
  function step(now) {
    if (!state.playing) return;
    state.t += ((now - lastTick) / 1000) * state.speed; lastTick = now;
    go(nearest(state.t));
    if (state.k >= head.images - 1) { play(false); return; }
    requestAnimationFrame(step);
  }
  function controls() {
    const footer = document.getElementById("player");
    els.play = button("play", "play", "space", () => play(!state.playing));
    els.slider = document.createElement("input");
    Object.assign(els.slider, { type: "range", id: "slider", min: 0, max: head.images - 1, step: 1, value: 0, title: "arrows: an image, with shift a second; home, end" });
    els.slider.setAttribute("aria-label", "time");
    els.slider.oninput = () => { play(false); go(Number(els.slider.value)); };
    els.clock = document.createElement("span"); els.clock.id = "clock";
    footer.replaceChildren(els.play, select([["0.25", "x 0.25"], ["1", "x 1"], ["4", "x 4"], ["16", "x 16"], ["64", "x 64"]], "1", "speed",
      (value) => { state.speed = Number(value); }), els.slider, els.clock);
    els.frame = select([["vehicle", "from the vehicle, stretched"], ["world", "on the ground, true to scale"]], state.frame, "frame", (value) => { state.frame = value; go(state.k); });
    els.span = select([["auto", "zoom: automatic"], ["50", "50 m"], ["100", "100 m"], ["200", "200 m"], ["500", "500 m"]], state.span, "zoom", (value) => { state.span = value; go(state.k); });
    document.getElementById("above-tools").replaceChildren(els.frame, els.span);
    const which = select([["analysis", "analysis"], ["quality", "quality"], ["above", "from above"], ["overview", "overview"]], "analysis", "view to export", () => {});
    which.id = "export-view";
    const image = (format) => () => {
      const box = document.getElementById(which.value), graph = box.classList.contains("js-plotly-plot") ? box : box.querySelector(".js-plotly-plot");
      Plotly.downloadImage(graph, { format, width: 1200, height: 700, filename: `${head.log}_${which.value}` });
    };
    document.getElementById("tools").replaceChildren("export ", which, button("png", "PNG", "the view as a picture", image("png")), button("svg", "SVG", "the view as a drawing", image("svg")),
      button("csv", "CSV", "all points of the analysis", () => { location.href = "/view.csv?" + query(); }),
      button("link", "copy link", "a link that restores this view", () => { remember(); if (navigator.clipboard) navigator.clipboard.writeText(location.href); }));
  }
  function query() {
    const v = state.view;
    return new URLSearchParams({ function: v.function, range: v.range, sort: v.sort, sides: (v.sides || []).join(","), signal: v.signal || "", image: state.k }).toString();
  }
  function keys(event) {
    const tag = event.target.tagName, typing = tag === "INPUT" && event.target.type !== "range";
    if (!head || typing || tag === "TEXTAREA" || event.ctrlKey || event.altKey || event.metaKey || event.target.getAttribute("role") === "combobox") return;
    const stepBy = event.shiftKey ? 25 : 1;
    const done = { " ": () => play(!state.playing), ArrowRight: () => go(state.k + stepBy), ArrowLeft: () => go(state.k - stepBy), Home: () => go(0), End: () => go(head.images - 1) }[event.key];
    if (!done || (event.key === " " && tag === "BUTTON")) return;
    if (event.key !== " ") play(false);
    event.preventDefault(); done();
  }

  // ---- the link that restores a view ------------------------------------------------------------------
  function remember() {
    const link = new URLSearchParams(query()); link.set("frame", state.frame); link.set("zoom", state.span);
    history.replaceState(null, "", "#" + link);
  }
  function restore() {
    const link = state.wanted; state.wanted = null;
    if (!link) return;
    for (const name of ["function", "sort", "signal"]) if (link.get(name)) dash_clientside.set_props(name, { value: link.get(name) });
    if (link.get("range")) dash_clientside.set_props("range", { value: Number(link.get("range")) });
    if (link.has("sides")) dash_clientside.set_props("sides", { value: link.get("sides").split(",").filter(Boolean) });
    if (link.get("frame")) { state.frame = link.get("frame"); els.frame.value = state.frame; }
    if (link.get("zoom") in SPAN_M) { state.span = link.get("zoom"); els.span.value = state.span; }
    const k = Number(link.get("image"));
    if (Number.isFinite(k)) go(k);
  }
  function start() {
    if (drawn || !head) return;
    if (!window.Plotly || !document.getElementById("above") || state.view.function === undefined) { setTimeout(start, 30); return; }
    drawn = true;
    els.above = document.getElementById("above"); els.overview = document.getElementById("overview");
    controls(); panels(); drawOverview();
    if (state.wanted) restore();
    go(state.k);
  }

  function linked(hash) { if (hash.length > 1) state.wanted = new URLSearchParams(hash.slice(1)); }
  linked(location.hash);
  window.addEventListener("hashchange", (event) => { // another link in the same tab; `remember` may have written over it
    linked(new URL(event.newURL).hash); if (drawn) restore();
  });
  window.vsensorExamine = { state, drawTimes, go, shown: -1 };
  window.dash_clientside = Object.assign({}, window.dash_clientside, {
    examine: {
      chosen(fn, range, sort, sides, signal) {
        state.view = { function: fn, range, sort, sides, signal };
        document.querySelectorAll(".choice.signal").forEach((e) => { e.style.display = fn === "signal" ? "block" : "none"; });
        if (drawn && !state.wanted) { go(state.k); remember(); }
        return true;
      },
      jump(analysis, quality, found) {
        const by = dash_clientside.callback_context.triggered.map((t) => t.prop_id);
        if (by.includes("found.data")) { if (found) go(found.number); else say("no error at this range"); }
        else if (by.includes("quality.clickData") && quality) go(nearest(quality.points[0].x));
        else if (analysis && analysis.points[0].customdata !== undefined) go([].concat(analysis.points[0].customdata)[0]);
        return null;
      },
    },
  });
  document.addEventListener("keydown", keys);
  document.addEventListener("click", (event) => { // by the mouse: the keys are the drive's again
    const focused = document.activeElement;
    if (event.detail > 0 && focused && ["radio", "checkbox"].includes(focused.type)) focused.blur();
  });
  window.addEventListener("resize", () => { if (drawn) go(state.k); });
  load();
})();
