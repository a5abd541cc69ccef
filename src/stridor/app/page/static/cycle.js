"use strict";
// Limit cycles at one friction coefficient: a row for each as it is found, and one period of the chosen one.
const stridorCycle = (() => {
  const $ = (id) => document.getElementById(id);
  const { text, clear, shown, axes, round, title, legend, strips, length } = stridorRun.tools;
  const page = { charts: {}, colours: {}, mu: null, cycles: [], chosen: 0, contact: 0 };
  const chartOf = (name) => getElement(page.charts[name])?.chart;
  const element = (name, attributes = {}, ...content) => {
    const made = document.createElement(name);
    for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
    made.append(...content);
    return made;
  };
  const capital = (words) => `${words[0].toUpperCase()}${words.slice(1)}`;
  const stability = (c) => ({ true: "stable", false: "unstable", null: "undecided" })[String(c.stable)];
  const duration = (s) => (s >= 1 ? [1, "s"] : s >= 1e-3 ? [1e3, "ms"] : [1e6, "µs"]);
  const said = (words) => { $("st-cycle-said").textContent = words; };
  function running(on) {
    $("st-cycle-go").disabled = on;
    $("st-cycle-stop").disabled = !on;
    $("st-cycle-progress").hidden = !on;
  }

  // -- what was found ------------------------------------------------------------------------------------------------
  function list() {
    const heads = ["cycle", "frequency [Hz]", "largest multiplier", "slip ± [m/s]", ""];
    const rows = page.cycles.map((c, k) => {
      const button = element("button", { type: "button", "aria-pressed": String(k === page.chosen), "aria-label": `cycle ${k + 1}, ${shown(c.frequency_hz)} Hz, ${stability(c)}` }, String(k + 1));
      button.addEventListener("click", () => { page.chosen = k; list(); draw(); $("st-cycle-found").querySelectorAll("button")[k].focus({ preventScroll: true }); });
      const cells = [button, c.frequency_hz.toPrecision(6), shown(c.largest_multiplier), shown(c.slip_amplitude), stability(c)];
      return element("tr", { class: k === page.chosen ? "st-chosen" : "" }, ...cells.map((v) => element("td", {}, v)));
    });
    const table = element("table", {}, element("thead", {}, element("tr", {}, ...heads.map((h) => element("th", { scope: "col" }, h)))), element("tbody", {}, ...rows));
    const c = page.cycles[page.chosen];
    $("st-cycle-found").replaceChildren(...(c ? [table, ...facts(c)] : []));
  }
  function facts(c) {
    const found = [];
    if (c.contacts.length > 1) {
      const select = element("select", { id: "st-cycle-contact" }, ...c.contacts.map((one, k) => new Option(one.name, k, k === page.contact, k === page.contact)));
      select.addEventListener("change", () => { page.contact = Number(select.value); draw(); });
      found.push(element("div", { class: "st-run-tools" }, element("label", { for: "st-cycle-contact" }, "contact"), select));
    }
    const shares = c.contacts.map((one) => `contact ${one.name} ${["is open", "sticks", "slips"].map((w, k) => [w, one.shares[k]]).filter(([, s]) => s > 0).map(([w, s]) => `${w} ${(100 * s).toFixed(1)} %`).join(", ")} of the period`);
    const rested = c.landed ? ` Contacts throw one another off without end and were brought to rest (${c.landed} ×), which is not exact.` : "";
    found.push(element("p", { class: "st-note" }, `${capital(shares.join("; "))}. Reached from ${c.reached_from}.${rested}`));
    return found;
  }

  // -- one period ----------------------------------------------------------------------------------------------------
  function put(name, option, words) {
    const chart = chartOf(name);
    chart.setOption(option, { notMerge: true, lazyUpdate: true });
    chart.getDom().setAttribute("role", "img");
    chart.getDom().setAttribute("aria-label", words);
  }
  // What the contact does, as the ground of a chart: a series for each kind, so that a legend can name it.
  const ground = (contact, end) => [...new Set(contact.strips.map((s) => s[2]))].map((kind) => ({
    id: kind, name: kind, type: "custom", silent: true, clip: true, z: 0, itemStyle: { color: strips()[kind] }, encode: { x: -1, y: -1 },
    data: contact.strips.filter((s) => s[2] === kind),
    renderItem: (params, api) => {
      const [a, b] = [0, 1].map((k) => api.coord([api.value(k) * end, 0])[0]), box = params.coordSys;
      return { type: "rect", shape: { x: a, y: box.y, width: b - a, height: box.height }, style: { fill: strips()[kind] } };
    },
  }));
  const ends = (...histories) => { const all = histories.flat(); return { min: Math.min(0, ...all), max: Math.max(0, ...all) }; };
  function draw() {
    const c = page.cycles[page.chosen];
    document.querySelectorAll(".st-cycle-chart").forEach((e) => { e.hidden = !c; });
    if (!c) return;
    const contact = c.contacts[Math.min(page.contact, c.contacts.length - 1)], [factor, unit] = duration(c.period), end = factor * c.period;
    const line = (id, name, values, colour) => ({ id, name, type: "line", silent: true, showSymbol: false, z: 3, lineStyle: { width: 1.3, color: colour }, itemStyle: { color: colour }, data: values.map((v, k) => [end * c.share[k], v]) });
    const period = `${shown(end)} ${unit}`, kinds = [...new Set(contact.strips.map((s) => s[2]))];
    const over = (o) => ({ ...o.xAxis, name: `time [${unit}] over one period`, splitLine: { show: false }, axisLabel: { ...o.xAxis.axisLabel, formatter: shown, showMaxLabel: false } });
    const range = (v, u) => `from ${shown(Math.min(...v))} to ${shown(Math.max(...v))} ${u}`;
    const forces = axes(false, "N", [0, end]), slips = axes(true, "m/s", [0, end]);
    put("force", { ...forces, xAxis: over(forces), title: title(`contact ${contact.name}: forces`), legend: legend(["normal", "friction"]), yAxis: { ...forces.yAxis, ...round(ends(contact.normal_force, contact.tangential_force)) },
      series: [...ground(contact, end), line("n", "normal", contact.normal_force, clear(page.colours.normal, "#9bd0f5")), line("t", "friction", contact.tangential_force, clear(page.colours.tangential, "#FFB48A"))] },
      `Forces at contact ${contact.name} over one period of ${period}: normal ${range(contact.normal_force, "N")}, friction ${range(contact.tangential_force, "N")}.`);
    put("slip", { ...slips, xAxis: over(slips), title: title("slip velocity"), legend: legend(kinds), yAxis: { ...slips.yAxis, ...round(ends(contact.slip_velocity)) },
      series: [...ground(contact, end), line("s", "slip velocity", contact.slip_velocity, clear(page.colours["slip velocity"], "#f0f0f0"))] },
      `Slip velocity at contact ${contact.name} over one period of ${period}: ${range(contact.slip_velocity, "m/s")}; ${kinds.join(", ")}.`);
    if (c.portrait) portrait(c.portrait, period);
    else chartOf("portrait").getDom().hidden = true;
  }
  function portrait(q, period) {
    const o = axes(true, "m/s", [0, 1]), [most, factor, unit] = length(q.displacement), label = { color: text(), fontSize: 10 };
    put("portrait", { ...o, title: title(`${q.label}, one period of ${period}`),
      xAxis: { ...o.xAxis, min: null, max: null, scale: true, name: `displacement about its mean [${unit}]`, axisLabel: { ...label, show: true, hideOverlap: true, formatter: shown } },
      yAxis: { ...o.yAxis, ...round({ min: Math.min(...q.velocity), max: Math.max(...q.velocity) }) },
      series: [{ id: "p", type: "line", silent: true, showSymbol: false, lineStyle: { width: 1.3, color: clear(page.colours.normal, "#5CB3E6") }, data: q.displacement.map((u, k) => [factor * u, q.velocity[k]]) }] },
      `Velocity over displacement of ${q.label} over one period of ${period}: displacements within ${shown(factor * most)} ${unit}.`);
  }

  // -- what the server says ------------------------------------------------------------------------------------------
  // What was looked for and not found, all of it, and what nobody can know from this.
  function more(c) {
    const several = (n, one, many) => `${n} ${n === 1 ? one : many}`;
    const block = (words, lines) => (lines.length ? [element("details", {}, element("summary", {}, words), element("ul", {}, ...lines.map((l) => element("li", {}, l))))] : []);
    $("st-cycle-more").replaceChildren(
      ...c.warnings.map((w) => element("p", { class: "st-note" }, capital(w))),
      ...block(`${several(c.missing.length, "search", "searches")} led to no cycle`, c.missing),
      ...block(`${several(c.notes.length, "motion", "motions")} died out`, c.notes),
      element("p", { class: "st-note" }, "There may be cycles to which none of these motions leads."));
  }
  function ended(c, stopped) {
    running(false);
    if (!c.missing) { said(`${capital(c.sentence)}.`); return; } // stopped before there was anything
    const none = page.cycles.length ? capital(c.sentence) : `At μ = ${shown(page.mu)} ${c.sentence}`;
    said(stopped ? `Stopped. ${none} so far.` : `${none}.`);
    more(c);
  }
  const failed = (words) => { running(false); said(words); };
  const parts = {
    waiting: (place) => said(`Waiting for its turn: number ${place} in the queue.`),
    begun: () => said("The motion is being prepared …"),
    log(words) { said(`${capital(words)} …${page.cycles.length ? ` ${page.cycles.length} found so far.` : ""}`); },
    cycle(c) { page.cycles.push(c); list(); draw(); },
    done: (c) => ended(c, false), stopped: (c) => ended(c, true),
    refused: failed, failed,
  };
  const show = (part, content) => parts[part]?.(content);
  function begin(mu) {
    Object.assign(page, { mu, cycles: [], chosen: 0, contact: 0 });
    list();
    draw();
    $("st-cycle-more").replaceChildren();
    stale(false);
    running(true);
    said("Starting …");
  }
  function stale(is) {
    $("st-cycle-title").textContent = is ? `Limit cycles at μ = ${shown(page.mu)}: the numbers have changed since` : "Limit cycles";
  }
  function start(charts, colours) {
    Object.assign(page, { charts, colours });
    draw();
    new MutationObserver(draw).observe(document.body, { attributes: true, attributeFilter: ["class"] });
  }
  const ready = () => {
    if (typeof emitEvent !== "function" || !window.socket?.connected || !$("st-cycle-go")) { setTimeout(ready, 30); return; }
    emitEvent("stridor-cycle-hello", {});
    $("st-cycle-go").addEventListener("click", () => { running(true); emitEvent("stridor-cycle", {}); });
    $("st-cycle-stop").addEventListener("click", () => emitEvent("stridor-cycle-stop", {}));
    page.ready = true;
  };
  setTimeout(ready, 0);
  return { page, start, show, begin, stale };
})();
