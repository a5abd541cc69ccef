"use strict";
// The page's own script: draws what the server says, and says what was moved. Nothing is fetched.
document.documentElement.lang = "en";
const stridor = (() => {
  const $ = (id) => document.getElementById(id);
  const state = {
    charts: {}, colours: {}, levers: [], values: {}, low: 0, high: 1, branch: null, locus: null, at: null, onsets: null,
    shape: null, geometry: null, link: "", waiting: {}, moves: 0, sent: {}, timer: null, drawn: {},
  };
  const dark = () => document.body.classList.contains("body--dark");
  const paint = () => ({ text: dark() ? "#d8d8d8" : "#222", line: dark() ? "#5a5e66" : "#999", grid: dark() ? "#33373e" : "#e4e4e4",
    stable: dark() ? "#5CB3E6" : state.colours.stable, unstable: dark() ? "#FF8A4C" : state.colours.unstable, ink: dark() ? "#f0f0f0" : state.colours.ink });

  function shown(value, digits = 4) {
    if (value === null || !Number.isFinite(value)) return "–";
    const size = Math.abs(value);
    if (size !== 0 && (size < 1e-3 || size >= 1e6)) return value.toExponential(digits - 1).replace(/\.?0+e/, "e").replace("e+", "e").replace(/^-/, "−");
    return String(Number(value.toPrecision(digits))).replace("-", "−");
  }
  const hertz = (f, digits = 1) => (f >= 100 ? f.toFixed(digits) : shown(f));
  const element = (name, attributes = {}, ...content) => {
    const made = document.createElement(name);
    for (const [key, value] of Object.entries(attributes)) if (value !== null) made.setAttribute(key, value);
    made.append(...content);
    return made;
  };

  // -- levers: a slider and a number field each -------------------------------------------------------------------
  const toSlider = (l, v) => Math.round(l.steps * (l.log ? Math.log(v / l.low) / Math.log(l.high / l.low) : (v - l.low) / (l.high - l.low)));
  const fromSlider = (l, k) => Number((l.log ? l.low * (l.high / l.low) ** (k / l.steps) : l.low + (l.high - l.low) * (k / l.steps)).toPrecision(6));
  const written = (v) => {
    const text = String(Number(Number(v).toPrecision(7)));
    return text.length > 8 && Math.abs(v) >= 1e6 ? Number(v).toExponential(5).replace(/\.?0+e\+?/, "e") : text;
  };

  // Moves are sent at most every 25 ms, the newest of each lever; the server keeps the newest of all.
  function move(path, value) {
    state.values[path] = value;
    state.waiting[path] = value;
    if (path === "mu") placeLines();
    if (state.timer === null) {
      send();
      state.timer = setTimeout(send, 25);
    }
  }
  function send() {
    state.timer = null;
    const moved = Object.entries(state.waiting);
    state.waiting = {};
    for (const [path, value] of moved) emitEvent("stridor-move", { path, value, number: (state.sent[path] = ++state.moves) });
    if (moved.length) state.timer = setTimeout(send, 25);
  }

  function levers(given) {
    state.levers = given.levers;
    state.values = given.values;
    const box = $("st-levers");
    box.replaceChildren();
    let group = null, field = null;
    for (const lever of given.levers) {
      if (lever.group !== group) {
        group = lever.group;
        field = element("fieldset", {}, element("legend", {}, group));
        box.append(field);
      }
      field.append(leverRow(lever));
    }
    values(given.values);
  }
  function leverRow(lever) {
    const words = lever.unit ? `${lever.label} [${lever.unit}]` : lever.label, id = `st-lever-${lever.path}`;
    const slider = element("input", { type: "range", id, min: 0, max: lever.steps, step: 1, "data-path": lever.path, "aria-label": words });
    const number = element("input", { type: "text", inputmode: "decimal", "data-number": lever.path, "aria-label": `${words}, number`, autocomplete: "off" });
    slider.addEventListener("input", () => {
      const value = fromSlider(lever, Number(slider.value));
      number.value = written(value);
      told(slider, lever, value);
      move(lever.path, value);
    });
    const taken = () => {
      const value = Number(number.value.replace(",", "."));
      if (number.value.trim() === "" || !Number.isFinite(value)) {
        number.setAttribute("aria-invalid", "true");
        problem(`${lever.path}: ${number.value} – a number${lever.unit ? ` [${lever.unit}]` : ""}`);
        return;
      }
      number.removeAttribute("aria-invalid");
      if (value !== state.values[lever.path]) move(lever.path, value);
    };
    number.addEventListener("change", taken);
    const row = element("div", { class: "st-lever" }, element("label", { for: id }, lever.label), slider, number,
      element("span", { class: "st-unit" }, lever.unit));
    if (lever.note) {
      slider.setAttribute("aria-describedby", `${id}-note`);
      row.append(element("p", { class: "st-note", id: `${id}-note` }, lever.note));
    }
    return row;
  }
  const told = (slider, lever, value) => slider.setAttribute("aria-valuetext", `${written(value)} ${lever.unit}`);
  // heard: the number of the newest move that the server knew of when it said so. What was moved after that stays.
  function values(given, heard = Infinity) {
    for (const lever of state.levers) {
      const value = given[lever.path], newer = lever.path in state.waiting || (state.sent[lever.path] ?? 0) > heard;
      if (value === undefined || (newer && heard !== Infinity)) continue;
      state.values[lever.path] = value;
      const slider = document.querySelector(`[data-path="${CSS.escape(lever.path)}"]`);
      const number = document.querySelector(`[data-number="${CSS.escape(lever.path)}"]`);
      if (slider && document.activeElement !== slider) slider.value = toSlider(lever, value);
      if (slider) told(slider, lever, value);
      if (number && document.activeElement !== number) {
        number.value = written(value);
        number.removeAttribute("aria-invalid");
      }
    }
  }

  // -- curves ------------------------------------------------------------------------------------------------------
  const chartOf = (name) => getElement(state.charts[name])?.chart;
  const KINDS = { frequency: ["frequency_hz", "frequency [Hz]"], growth: ["growth_rate", "growth rate [1/s]"] };

  function curves(key, wanted) {
    const drawn = [];
    for (const b of state.locus.branches) {
      let on = false;
      for (let k = 0; k < state.locus.mu.length; k++) {
        if (wanted(b, k) && b[key][k] !== null) {
          drawn.push([state.locus.mu[k], b[key][k], b.branch]);
          on = true;
        } else if (on) {
          drawn.push(["-", "-"]);
          on = false;
        }
      }
      drawn.push(["-", "-"]);
    }
    return drawn;
  }
  // A stretch between an unstable μ and its neighbours counts as unstable where both ends are.
  function draw() {
    if (!state.locus) return;
    const p = paint();
    for (const [name, [key, axis]] of Object.entries(KINDS)) {
      const chart = chartOf(name);
      if (!chart) continue;
      const line = (id, data, colour, width, z) => ({ id, name: id, type: "line", data, showSymbol: false, silent: true, animation: false, z,
        lineStyle: { color: colour, width }, itemStyle: { color: colour } });
      const chosen = (b) => b.branch === state.branch;
      const series = [
        line("modes", curves(key, () => true), p.stable, 1.2, 2),
        line("unstable", curves(key, (b, k) => b.unstable[k]), p.unstable, 2.4, 3),
        line("chosen mode", curves(key, chosen), p.ink, 3.2, 4),
        { id: "onsets", name: "onset, solved", type: "scatter", symbol: "diamond", symbolSize: 9, silent: true, animation: false, z: 6,
          itemStyle: { color: p.ink }, labelLayout: { hideOverlap: true },
          label: { show: name === "frequency", position: "right", distance: 6, offset: [-4, -19], color: p.text, fontSize: 11, lineHeight: 13, formatter: (d) => d.data.words,
            backgroundColor: dark() ? "rgba(27,29,34,.85)" : "rgba(255,255,255,.85)", padding: 2 },
          data: onsetPoints(name) },
      ];
      // What stays between moves, axes, colours and labels, is not told again: that takes as long as the curves.
      const drawn = `${state.low} ${state.high} ${dark()}`;
      if (chart.drawnWith === drawn) chart.setOption({ series: series.map(({ id, type, data }) => ({ id, type, data })) });
      else chart.setOption({
        animation: false, backgroundColor: "transparent",
        grid: { left: 80, right: 16, top: 10, bottom: 36, outerBoundsMode: "none" },
        xAxis: { type: "value", min: state.low, max: state.high, name: "friction coefficient μ", nameLocation: "middle", nameGap: 22, nameTextStyle: { color: p.text },
          axisLabel: { color: p.text }, axisLine: { lineStyle: { color: p.line } }, splitLine: { lineStyle: { color: p.grid } } },
        yAxis: { type: "value", name: axis, nameLocation: "middle", nameGap: 60, min: name === "frequency" ? 0 : null, nameTextStyle: { color: p.text },
          axisLabel: { color: p.text, formatter: (v) => shown(v) }, axisLine: { show: true, lineStyle: { color: p.line } }, splitLine: { lineStyle: { color: p.grid } } },
        series,
      });
      chart.drawnWith = drawn;
      chart.getDom().setAttribute("role", "img");
      chart.getDom().setAttribute("aria-label", described(name));
      line_(name, chart);
    }
    placeLines();
  }
  function onsetPoints(name) {
    if (!state.onsets) return [];
    const inside = state.onsets.onsets.filter((o) => o.mu >= state.low && o.mu <= state.high);
    return inside.map((o) => ({ value: [o.mu, name === "frequency" ? o.frequency_hz : 0], words: `μ = ${o.mu.toPrecision(4)}\n${hertz(o.frequency_hz, 0)} Hz` }));
  }
  function described(name) {
    const what = name === "frequency" ? "Frequencies" : "Growth rates";
    const on = state.onsets ? state.onsets.words.join("; ") || "no onset" : "onsets are being solved";
    return `${what} of ${state.locus.branches.length} modes over friction from ${state.low} to ${state.high}. ${on}.`;
  }

  // The μ of the page: a line over each chart that is dragged, or moved by the arrow keys.
  function line_(name, chart) {
    const home = chart.getDom();
    if (home.parentNode.querySelector(`[data-line="${name}"]`)) return;
    const box = element("div", { class: "st-chart-box" });
    home.parentNode.insertBefore(box, home);
    const handle = element("div", { class: "st-mu", "data-line": name, ...(name === "frequency"
      ? { role: "slider", tabindex: 0, "aria-label": "friction μ of the page", "aria-orientation": "horizontal" } : { "aria-hidden": "true" }) },
    element("span", { class: "st-mu-words" }));
    box.append(home, handle);
    const at = (event) => {
      const x = event.clientX - home.getBoundingClientRect().left;
      const mu = chart.convertFromPixel({ xAxisIndex: 0 }, x);
      return Number(Math.min(state.high, Math.max(state.low, mu)).toPrecision(4));
    };
    handle.addEventListener("pointerdown", (event) => { handle.setPointerCapture(event.pointerId); handle.dataset.held = "1"; event.preventDefault(); handle.focus({ preventScroll: true }); });
    handle.addEventListener("pointermove", (event) => { if (handle.dataset.held) { move("mu", at(event)); values(state.values); } });
    for (const end of ["pointerup", "pointercancel"]) handle.addEventListener(end, () => { delete handle.dataset.held; });
    handle.addEventListener("keydown", (event) => {
      const step = (state.high - state.low) / (event.shiftKey ? 20 : 200);
      const by = { ArrowLeft: -step, ArrowDown: -step, ArrowRight: step, ArrowUp: step, Home: -1e9, End: 1e9 }[event.key];
      if (by === undefined) return;
      event.preventDefault();
      move("mu", Number(Math.min(state.high, Math.max(state.low, state.values.mu + by)).toPrecision(6)));
      values(state.values);
    });
    home.addEventListener("click", (event) => choose(nearest(name, chart, event, home)));
    new ResizeObserver(placeLines).observe(home);
  }
  function placeLines() {
    for (const name of Object.keys(KINDS)) {
      const chart = chartOf(name), handle = document.querySelector(`[data-line="${name}"]`);
      if (!chart || !handle || !state.locus) continue;
      const mu = state.values.mu ?? 0, x = chart.convertToPixel({ xAxisIndex: 0 }, Math.min(state.high, Math.max(state.low, mu)));
      handle.style.left = `${x}px`;
      handle.classList.toggle("st-left-of", mu > (state.low + state.high) / 2);
      handle.querySelector("span").textContent = name === "frequency" ? `μ = ${written(Number(mu.toPrecision(4)))}` : "";
      if (name === "frequency") {
        for (const [key, value] of [["valuemin", state.low], ["valuemax", state.high], ["valuenow", mu], ["valuetext", `μ = ${written(mu)}`]]) handle.setAttribute(`aria-${key}`, value);
      }
    }
  }
  function nearest(name, chart, event, home) {
    const box = home.getBoundingClientRect(), x = event.clientX - box.left, y = event.clientY - box.top;
    let best = null, least = 20;
    for (const b of state.locus?.branches ?? []) {
      for (let k = 0; k < state.locus.mu.length; k++) {
        const value = b[KINDS[name][0]][k];
        if (value === null) continue;
        const [px, py] = chart.convertToPixel({ xAxisIndex: 0, yAxisIndex: 0 }, [state.locus.mu[k], value]);
        const away = Math.hypot(0.4 * (px - x), py - y);
        if (away < least) [best, least] = [b.branch, away];
      }
    }
    return best;
  }
  function choose(branch) {
    if (branch === null) return;
    state.branch = branch;
    emitEvent("stridor-choose", { branch });
    draw();
    list();
  }

  // -- words -------------------------------------------------------------------------------------------------------
  function said(busy, stage) {
    const on = state.onsets;
    let text = "";
    if (state.progress) text = `${state.progress[0].toUpperCase()}${state.progress.slice(1)}.`;
    else if (state.refused && !state.locus) text = "Nothing could be computed for these numbers.";
    else if (!on) text = state.locus ? "The onsets are being solved." : "The modes are being computed.";
    else if (on.first) text = `Growth begins at μ = ${on.first.mu.toPrecision(5)}, ${hertz(on.first.frequency_hz)} Hz (${on.onsets.length} onset${on.onsets.length === 1 ? "" : "s"} solved).`;
    else text = on.growing_at_start.length ? `Something grows already at μ = ${on.friction_range[0]}.` : `Nothing grows up to μ = ${on.friction_range[1]}.`;
    if (on && !on.complete) text += ` ${on.completeness}`;
    if (state.refused && state.locus && !state.progress) text = `Of the last numbers that could be computed: ${text[0].toLowerCase()}${text.slice(1)}`;
    const box = $("st-said");
    if (box && box.textContent !== text) box.textContent = text;
    document.body.classList.toggle("st-busy", Boolean(busy));
  }
  function list() {
    const at = state.at, box = $("st-modes-list");
    if (!at || !box) return;
    const growing = at.modes.filter((m) => m.unstable).length;
    $("st-modes-title").textContent = `Modes at μ = ${written(at.mu)}`;
    const box_ = $("st-modes-said");
    box_.replaceChildren(state.refused ? "Of the last numbers that could be computed. " : "", `${at.modes.length} modes, ${growing || "none"} growing. `);
    if (at.said) box_.append(at.said);
    else if (!at.checked) box_.append("Followed from μ = 0, not checked yet.");
    else if (at.completeness) box_.append(element("details", {}, element("summary", {}, at.completeness.split(/[.:]/)[0]), at.completeness));
    const scroll = box.scrollTop, held = document.activeElement?.dataset?.branch;
    const rows = at.modes.map((m) => {
      const button = element("button", { type: "button", "data-branch": m.branch, "aria-pressed": String(m.branch === state.branch), "aria-label": `mode ${m.branch}, ${hertz(m.frequency_hz)} Hz, ${m.unstable ? "growing" : "stable"}` }, String(m.branch));
      button.addEventListener("click", () => choose(m.branch));
      return element("tr", { class: `${m.unstable ? "st-grows" : ""} ${m.branch === state.branch ? "st-chosen" : ""}` },
        element("td", {}, button), element("td", {}, hertz(m.frequency_hz)), element("td", {}, shown(m.growth_rate)), element("td", {}, m.unstable ? "growing" : "stable"));
    });
    const head = element("tr", {}, ...["mode", "frequency [Hz]", "growth [1/s]", ""].map((h) => element("th", { scope: "col" }, h)));
    box.replaceChildren(element("table", {}, element("thead", {}, head), element("tbody", {}, ...rows)));
    box.scrollTop = scroll;
    if (held) box.querySelector(`[data-branch="${held}"]`)?.focus({ preventScroll: true });
  }

  // -- the chosen mode ---------------------------------------------------------------------------------------------
  const frame = () => $("st-mode-frame")?.contentWindow;
  // What draws modes of solids with the graphics card, for the frame, which may fetch nothing itself.
  let fetched = null;
  const viewer = () => (fetched ??= fetch("viewer.js").then((answer) => (answer.ok ? answer.text() : Promise.reject(answer.status))));
  function shape() {
    const s = state.shape;
    $("st-mode-none").hidden = Boolean(s);
    $("st-mode-shown").hidden = !s;
    if (!s) return;
    $("st-mode-title").textContent = s.missing ? `Mode ${s.branch}` : `Mode ${s.branch} at μ = ${written(s.mu)}`;
    $("st-mode-undrawn").hidden = !(s.missing || s.undrawn);
    $("st-mode-undrawn").textContent = s.missing || s.undrawn || "";
    $("st-mode-frame").hidden = Boolean(s.missing || s.undrawn);
    if (s.geometry) state.geometry = s.geometry;
    if (s.motion) Object.assign(state.geometry ?? {}, s.motion);
    if (s.motion) frame()?.postMessage({ ...(s.geometry ? { geometry: state.geometry } : { motion: s.motion }), title: s.title, growth: s.growth, unstable: s.unstable }, "*");
    facts(s);
  }
  function facts(s) {
    const box = $("st-mode-facts");
    box.replaceChildren();
    if (s.missing) return;
    const lines = [`damping ratio ${shown(100 * s.damping_ratio)} %`];
    for (const b of s.bodies) lines.push(`${b.body}: ${(100 * b.share).toFixed(1)} % of the kinetic energy, phase ${b.phase_deg === null ? "–" : `${shown(Math.round(b.phase_deg))}°`}`);
    for (const c of s.contacts.each) lines.push(`friction at ${c.contact}: ${shown(100 * c.per_cycle, 3)} % of the mode's energy per cycle ${c.per_cycle > 0 ? "fed in" : "taken out"}`);
    if (s.contacts.damping !== undefined) lines.push(`damping: ${shown(100 * s.contacts.damping, 3)} % per cycle`);
    if (s.contacts.why) lines.push(`energy of friction: ${s.contacts.why}`);
    box.append(element("ul", {}, ...lines.map((l) => element("li", {}, l))));
  }
  function tornado(given) {
    if (given.branch !== state.branch || (state.shape && given.mu !== state.shape.mu)) return; // of another mode
    const box = $("st-tornado");
    box.replaceChildren();
    if (given.seconds !== undefined) { stridorTornado.offer(given.seconds); return; }
    const most = Math.max(...given.bars.map((b) => Math.abs(b.growth)), 1e-300);
    const rows = given.bars.slice(0, 10).map((b) => {
      if (Math.abs(b.growth) < 1e-9 * most) b.growth = 0;
      const bar = element("span", { class: `st-bar ${b.growth > 0 ? "st-more" : "st-less"}` });
      bar.style.width = `${(50 * Math.abs(b.growth)) / most}%`;
      return element("tr", {}, element("th", { scope: "row", title: b.path }, ...b.path.split(/(?<=\.)/).flatMap((part) => [part, element("wbr")])), element("td", { class: "st-bars", "aria-hidden": "true" }, bar),
        element("td", {}, `${b.growth > 0 ? "+" : ""}${shown(b.growth, 3)}`), element("td", {}, `${b.frequency_hz > 0 ? "+" : ""}${shown(Math.abs(b.frequency_hz) < 1e-9 * Math.abs(given.frequency_hz) ? 0 : b.frequency_hz, 3)}`));
    });
    const head = element("tr", {}, ...["number, + 1 %", "", "growth [1/s]", "frequency [Hz]"].map((h) => element("th", { scope: "col" }, h)));
    if (rows.length) box.append(element("table", {}, element("thead", {}, head), element("tbody", {}, ...rows)));
    for (const w of given.warnings) box.append(element("p", { class: "st-note" }, w));
  }

  // -- what the server says ----------------------------------------------------------------------------------------
  // What was refused of an answer is over with the next answer; what was refused of a file or a link stays to be read.
  function unanswered(text) {
    problem(text);
    state.answers = state.refused = true;
    list();
  }
  function answered() {
    if (state.answers) problem("");
    state.refused = false;
  }
  function problem(text) {
    state.answers = false; // whether what is said is of an answer
    const box = $("st-problem");
    box.textContent = text;
    box.hidden = !text;
  }
  function follow(given) {
    Object.assign(state, { low: given.low, high: given.high, link: given.link });
    if (given.branch !== state.branch || given.branch === null) {
      state.branch = given.branch;
      if (given.branch === null) { state.shape = null; shape(); }
      list();
    }
    values(given.values, given.heard);
    placeLines();
    history.replaceState(null, "", given.link ? `#${given.link}` : location.pathname + location.search);
  }
  // Another case is open: nothing of the one before is shown under its name.
  function forget() {
    Object.assign(state, { locus: null, at: null, onsets: null, shape: null, geometry: null, refused: false, progress: "" });
    for (const chart of Object.keys(KINDS).map(chartOf)) if (chart) { chart.clear(); chart.drawnWith = null; }
    document.querySelectorAll(".st-mu").forEach((e) => { e.hidden = true; });
    for (const id of ["st-model", "st-modes-list", "st-mode-facts", "st-tornado"]) $(id)?.replaceChildren();
    for (const id of ["st-title", "st-modes-said"]) $(id).textContent = "";
    $("st-modes-title").textContent = "Modes";
    stridorTornado.hide();
    shape();
    said(true);
  }
  const parts = {
    model(c) {
      $("st-model").innerHTML = c.svg || "<p class='st-note'>Matrices or masses without a shape: there is nothing to draw.</p>";
      $("st-title").textContent = c.title;
      if (c.why) problem(c.why);
    },
    locus(c) { state.locus = c; state.onsets = null; state.progress = ""; answered(); draw(); document.querySelectorAll(".st-mu").forEach((e) => { e.hidden = false; }); stamp("locus"); },
    at(c) { state.at = c; answered(); list(); stamp("at"); },
    onsets(c) { state.onsets = c; draw(); },
    shape(c) {
      if (state.shape?.branch !== c.branch || state.shape?.mu !== c.mu) {
        stridorTornado.hide();
        $("st-tornado").replaceChildren(element("p", { class: "st-note" }, c.missing ? "" : "Being computed."));
      }
      state.shape = c;
      shape();
    },
    tornado,
    progress(c) { state.progress = c.what; },
    declined: problem, // a case that is not opened; what is shown is of the one before, and stays
    refused: unanswered, unanswered, failed: unanswered,
  };
  // How often each part was drawn, for measurements: counted when it is on the screen.
  const stamp = (part) => requestAnimationFrame(() => { state.drawn[part] = (state.drawn[part] ?? 0) + 1; });
  function show(part, content, busy) {
    parts[part]?.(content);
    said(busy);
  }
  function turnDark() {
    Quasar.Dark.set(!dark());
  }
  function repaint() {
    frame()?.postMessage({ dark: dark() }, "*");
    draw();
  }
  function start(charts, colours) {
    Object.assign(state, { charts, colours });
    said(true);
  }
  window.addEventListener("message", (event) => {
    if (event.source !== frame()) return;
    // Without it the frame goes on as it is.
    if (event.data === "stridor-viewer-wanted") viewer().then((text) => frame()?.postMessage({ viewer: text }, "*"), () => {});
    if (event.data !== "stridor-mode-ready") return;
    frame().postMessage({ dark: dark() }, "*");
    if (state.shape?.motion && state.geometry) { state.shape.geometry = state.geometry; shape(); }
  });
  // Charts and socket are there a moment after the page.
  const hello = () => {
    if (typeof emitEvent === "function" && window.socket?.connected && $("st-levers")) {
      new MutationObserver(repaint).observe(document.body, { attributes: true, attributeFilter: ["class"] });
      emitEvent("stridor-hello", { link: location.hash.slice(1) });
    } else setTimeout(hello, 30);
  };
  setTimeout(hello, 0);
  // Who closes or reloads the page is gone at once; who is only not heard of has a while to come back.
  window.addEventListener("pagehide", (event) => { if (!event.persisted && typeof emitEvent === "function") emitEvent("stridor-bye", {}); });
  const copyLink = () => navigator.clipboard?.writeText(location.href).catch(() => problem("the link could not be copied: take the address of the page"));
  return { state, levers, follow, forget, show, problem, start, turnDark, copyLink };
})();
