"use strict";
// The run in time: curves that grow while it runs, and its sound. Drawn is what the server tells, which is whole each time.
const stridorRun = (() => {
  const $ = (id) => document.getElementById(id);
  const page = { charts: {}, colours: {}, picture: null, growing: [], mu: null, sonogramAt: 0, sound: null };
  const dark = () => document.body.classList.contains("body--dark");
  const text = () => (dark() ? "#d8d8d8" : "#222"), grid = () => (dark() ? "#33373e" : "#e4e4e4"), rule = () => (dark() ? "#5a5e66" : "#999");
  const clear = (light, night) => (dark() ? night : light);
  const chartOf = (name) => getElement(page.charts[name])?.chart;
  const shown = (v) => (v === 0 ? "0" : Math.abs(v) < 1e-3 || Math.abs(v) >= 1e5 ? v.toExponential(1).replace("e+", "e").replace("-", "−") : String(Number(v.toPrecision(4))).replace("-", "−"));

  function axes(bottom, unit, [least, most] = span()) {
    const label = { color: text(), fontSize: 10 };
    return {
      animation: false, backgroundColor: "transparent",
      grid: { left: 58, right: 12, top: 28, bottom: bottom ? 32 : 8, outerBoundsMode: "none" },
      xAxis: { type: "value", min: least, max: most, name: bottom ? `time [${clock()[1]}]` : "", nameLocation: "middle", nameGap: 18, nameTextStyle: label,
        axisLabel: { ...label, show: bottom, hideOverlap: true }, axisLine: { onZero: false, lineStyle: { color: rule() } }, splitLine: { lineStyle: { color: grid() } } },
      yAxis: { type: "value", scale: true, name: unit, nameLocation: "end", nameGap: 12, nameTextStyle: { ...label, align: "left", padding: [0, 0, 0, -52] }, splitNumber: 3,
        axisLabel: { ...label, formatter: shown }, axisLine: { show: true, onZero: false, lineStyle: { color: rule() } }, splitLine: { lineStyle: { color: grid() } } },
    };
  }
  const span = () => {
    const first = began(page.picture), [factor] = clock();
    return [factor * first, Math.max(factor * page.picture.end, factor * first + 1e-6)];
  };
  const began = (p) => (p.phases.length ? p.phases[0][1] : p.time[0]);
  // The factor and the unit of times, as the whole run will need them: they are not to change while it grows.
  function clock() {
    const p = page.picture;
    if (!p) return [1e3, "ms"]; // limit cycles are drawn with these axes where nothing has run
    const whole = ((p.end - began(p)) * p.planned) / Math.max(p.done, 1);
    return whole >= 1 ? [1, "s"] : [1e3, "ms"];
  }
  const times = (p) => inUnit(p.time);
  function inUnit(seconds) {
    const [factor] = clock();
    return seconds.map((t) => factor * t);
  }
  const lasting = (seconds) => (seconds >= 1 ? [seconds, "s"] : [1e3 * seconds, "ms"]);
  // A band from the least to the largest value of each stretch: one closed line, filled.
  function band(id, name, b, colour) {
    const t = times(page.picture), outline = [...t.map((x, k) => [x, b.high[k]]), ...t.map((x, k) => [x, b.low[k]]).reverse()];
    return { id, name, type: "custom", silent: true, clip: true, itemStyle: { color: colour }, data: [0], encode: { x: -1, y: -1 },
      renderItem: (_, api) => ({ type: "polygon", shape: { points: outline.map((p) => api.coord(p)) }, style: { fill: colour, stroke: colour, lineWidth: 1, opacity: 0.9 } }) };
  }
  const scale = (bands) => ({ min: Math.min(...bands.flatMap((b) => b.low)), max: Math.max(...bands.flatMap((b) => b.high)) });
  function put(name, option, words) {
    const chart = chartOf(name);
    if (!chart) return;
    chart.setOption(option, { notMerge: true, lazyUpdate: true });
    chart.getDom().setAttribute("role", "img");
    chart.getDom().setAttribute("aria-label", words);
  }
  // Ends of an axis at round numbers, three or four steps apart.
  function round(r) {
    const size = r.max - r.min || Math.abs(r.max) || 1, power = 10 ** Math.floor(Math.log10(size / 3));
    const interval = power * [1, 2, 2.5, 5, 10].find((k) => size / (k * power) <= 4);
    return { min: interval * Math.floor(r.min / interval), max: interval * Math.ceil(r.max / interval), interval, scale: false };
  }
  const legend = (data) => ({ right: 12, top: 0, icon: "rect", itemWidth: 10, itemHeight: 10, data, selectedMode: false, textStyle: { color: text(), fontSize: 10 } });
  const title = (words) => ({ text: words, left: 58, top: 2, textStyle: { fontSize: 11, fontWeight: 600, color: text() } });

  function draw() {
    const p = page.picture;
    if (!p || !p.time.length) return;
    document.querySelectorAll(".st-run-chart").forEach((e) => { e.hidden = false; });
    const [factor, unit] = clock(), until = `up to ${shown(factor * p.end)} ${unit}`;
    if (p.acceleration) {
      const a = p.acceleration, o = axes(false, "m/s²"), r = scale([a]);
      put("acceleration", { ...o, title: title(`acceleration of ${a.label}`), yAxis: { ...o.yAxis, ...round(r) }, series: [band("a", a.label, a, clear(page.colours.normal, "#5CB3E6"))] },
        `Acceleration of ${a.label} ${until}, from ${shown(r.min)} to ${shown(r.max)} m/s².`);
    }
    if (p.normal_force.length) {
      const n = p.normal_force[0], t = p.tangential_force[0], o = axes(false, "N"), r = scale([n, t]);
      put("force", { ...o, title: title(`contact ${n.label}: forces`), legend: legend(["normal", "tangential"]), yAxis: { ...o.yAxis, ...round(r) },
        series: [{ ...band("n", "normal", n, clear(page.colours.normal, "#5CB3E6")), markLine: phases(p) }, band("t", "tangential", t, clear(page.colours.tangential, "#FF8A4C"))] },
        `Forces at contact ${n.label} ${until}: normal from ${shown(Math.min(...n.low))} to ${shown(Math.max(...n.high))} N, tangential from ${shown(Math.min(...t.low))} to ${shown(Math.max(...t.high))} N.`);
      status(p, n.label);
    }
    if (p.portrait) portrait(p.portrait);
    if (p.sonogram && (p.done === p.planned || performance.now() - page.sonogramAt > 1200)) { page.sonogramAt = performance.now(); sonogram(p.sonogram); }
  }
  const phases = (p) => ({ silent: true, symbol: "none", animation: false, lineStyle: { color: rule(), type: "dotted" },
    label: { position: "insideEndTop", rotate: 0, fontSize: 10, color: text(), formatter: (d) => d.name, align: "left", offset: [9, 14] },
    data: p.phases.map(([name, start], k) => ({ name: room(p, k) ? name : "", xAxis: clock()[0] * start })) });
  // Whether the name of a phase has room before the next one begins.
  const room = (p, k) => {
    const [least, most] = span(), [factor] = clock(), end = k + 1 < p.phases.length ? factor * p.phases[k + 1][1] : most;
    return (end - factor * p.phases[k][1]) / (most - least) > 0.025 * p.phases[k][0].length;
  };
  const strips = () => (dark() ? { separation: "#b8672a", stick: "#3f78a8", slip: "#8d8353" } : page.colours);
  function status(p, contact) {
    const t = times(p), o = axes(true, ""), names = ["separation", "stick", "slip"], shares = p.status[contact];
    const mean = names.map((_, k) => shares[k].reduce((a, b) => a + b, 0) / t.length);
    const colours = strips();
    put("status", { ...o, grid: { ...o.grid, top: 20, bottom: 30 }, title: title(`contact ${contact}`),
      legend: legend(names),
      yAxis: { ...o.yAxis, min: 0, max: 1, scale: false, show: false },
      series: names.map((name, k) => ({ id: name, name, type: "line", stack: "s", silent: true, showSymbol: false, lineStyle: { width: 0 }, itemStyle: { color: colours[name] }, areaStyle: { color: colours[name], opacity: 1 }, data: t.map((x, i) => [x, shares[k][i]]) })) },
      `Contact ${contact} over the run so far: ${names.map((n, k) => `${(100 * mean[k]).toFixed(0)} % ${n}`).join(", ")}.`);
  }
  // The largest of lengths [m], and the factor and the unit that suit it.
  function length(values) {
    const most = Math.max(...values.map(Math.abs), 1e-300);
    return [most, ...(most > 0.5 ? [1, "m"] : most > 1e-4 ? [1e3, "mm"] : most > 1e-7 ? [1e6, "µm"] : [1e9, "nm"])];
  }
  function portrait(q) {
    const o = axes(true, "m/s"), label = { color: text(), fontSize: 10 };
    const [most, factor, unit] = length(q.displacement), [last, ends] = lasting(q.seconds);
    const r = { min: Math.min(...q.velocity), max: Math.max(...q.velocity) };
    put("portrait", { ...o, title: title(`${q.label}, the last ${shown(last)} ${ends}`),
      xAxis: { ...o.xAxis, min: null, max: null, scale: true, name: `displacement about its mean [${unit}]`, axisLabel: { ...label, show: true, hideOverlap: true, formatter: shown } },
      yAxis: { ...o.yAxis, ...round(r) },
      series: [{ id: "p", type: "line", silent: true, showSymbol: false, lineStyle: { width: 0.9, color: clear(page.colours.normal, "#5CB3E6") }, data: q.displacement.map((u, k) => [factor * u, q.velocity[k]]) }] },
      `Velocity over displacement of ${q.label} in the last ${shown(last)} ${ends}: displacements within ${shown(factor * most)} ${unit}.`);
  }
  const RAMP = [[0, 34, 78], [53, 69, 108], [102, 105, 112], [148, 142, 119], [200, 184, 102], [254, 232, 56]]; // cividis, as in the report
  function picture(s) {
    const canvas = document.createElement("canvas"), width = s.level.length, height = s.frequency_hz.length;
    Object.assign(canvas, { width, height });
    const context = canvas.getContext("2d"), image = context.createImageData(width, height);
    s.level.forEach((column, i) => column.forEach((v, j) => {
      const at = Math.min(Math.max((v + 60) / 60, 0), 1) * (RAMP.length - 1), k = Math.min(Math.floor(at), RAMP.length - 2), w = at - k, o = 4 * ((height - 1 - j) * width + i);
      for (let c = 0; c < 3; c++) image.data[o + c] = RAMP[k][c] * (1 - w) + RAMP[k + 1][c] * w;
      image.data[o + 3] = 255;
    }));
    context.putImageData(image, 0, 0);
    return canvas;
  }
  function sonogram(s) {
    const [per, unit] = s.frequency_hz[s.frequency_hz.length - 1] < 1e3 ? [1, "Hz"] : [1e3, "kHz"];
    const o = axes(true, unit), image = picture(s), t = inUnit(s.time), f = s.frequency_hz.map((x) => x / per);
    const half = (v) => (v.length > 1 ? (v[1] - v[0]) / 2 : v[0] || 0.5), top = f[f.length - 1] + half(f);
    const near = page.growing.filter((g) => g / per <= top);
    let loudest = [0, -1e9];
    s.level.forEach((column) => column.forEach((v, j) => { if (v > loudest[1]) loudest = [f[j], v]; }));
    put("sonogram", { ...o, title: title(near.length ? "spectrogram; dashed: modes that grow" : "spectrogram of the acceleration"),
      yAxis: { ...o.yAxis, scale: false, min: 0, max: top, axisLabel: { ...o.yAxis.axisLabel, showMaxLabel: false } },
      series: [{ id: "s", type: "custom", silent: true, clip: true, data: [0], encode: { x: -1, y: -1 },
        renderItem: (_, api) => {
          const [x0, y0] = api.coord([t[0] - half(t), f[0] - half(f)]), [x1, y1] = api.coord([t[t.length - 1] + half(t), top]);
          return { type: "image", style: { image, x: x0, y: y1, width: x1 - x0, height: y0 - y1 } };
        },
        markLine: { silent: true, symbol: "none", animation: false, lineStyle: { color: "#fff", type: "dashed", width: 1 }, label: { show: false }, data: near.map((g) => ({ yAxis: g / per })) } }] },
      `Short-time spectra; the loudest line lies at ${shown(loudest[0])} ${unit}.` + (near.length ? ` Modes that grow: ${near.map((g) => `${Math.round(g)} Hz`).join(", ")}.` : ""));
  }

  // -- the state of the run ------------------------------------------------------------------------------------------
  function said(words) { $("st-run-said").textContent = words; }
  function running(on) {
    $("st-run-go").disabled = on;
    $("st-run-stop").disabled = !on;
    $("st-run-progress").hidden = !on;
  }
  const ended = (c) => { running(false); said(`At μ = ${shown(page.mu)}: ${c.sentence}`); $("st-run-listen").disabled = !c.file; };
  const parts = {
    waiting: (place) => said(`Waiting for its turn: number ${place} in the queue.`),
    begun: () => said(`Running at μ = ${shown(page.mu)} …`),
    progress([done, planned]) {
      $("st-run-progress").value = done / Math.max(planned, 1);
      said(`Running at μ = ${shown(page.mu)}: ${(100 * done / Math.max(planned, 1)).toFixed(0)} % of ${planned.toLocaleString("en")} steps.`);
    },
    picture(c) { page.picture = c; $("st-run-listen").disabled = false; draw(); },
    sound: play,
    silent: (why) => said(`No sound: ${why}`),
    done: ended, stopped: ended,
    refused(words) { running(false); said(words); },
    failed(words) { running(false); said(words); },
  };
  const show = (part, content) => parts[part]?.(content);
  function begin(mu, growing) {
    Object.assign(page, { mu, growing, picture: null, sonogramAt: 0 });
    silence();
    stale(false);
    document.querySelectorAll(".st-run-chart").forEach((e) => { e.hidden = true; });
    $("st-run-listen").disabled = true;
    $("st-run-progress").value = 0;
    running(true);
    said("Starting …");
    $("st-run-said").classList.remove("st-stale");
  }
  function stale(is) {
    $("st-run-title").textContent = is ? `Run in time at μ = ${shown(page.mu)}: the numbers have changed since` : "Run in time";
  }

  // -- sound ---------------------------------------------------------------------------------------------------------
  function silence() {
    page.sound?.source.stop();
    page.sound?.context.close();
    page.sound = null;
    $("st-run-listen").textContent = "Listen";
  }
  function listen() {
    if ($("st-run-stop").disabled) said("The sound is being made …"); // of a run that has ended
    emitEvent("stridor-run-listen", { slow: Number($("st-run-slow").value) });
  }
  async function play(c) {
    silence();
    const bytes = Uint8Array.from(atob(c.wav), (x) => x.charCodeAt(0));
    const context = new AudioContext(), buffer = await context.decodeAudioData(bytes.buffer), source = context.createBufferSource();
    source.buffer = buffer;
    source.loop = true;
    source.connect(context.destination);
    source.start();
    page.sound = { context, source, seconds: buffer.duration };
    $("st-run-listen").textContent = "Silence";
    said(`Heard, over and over: ${c.sentence}.`);
  }

  function start(charts, colours) {
    Object.assign(page, { charts, colours });
    document.querySelectorAll(".st-run-chart").forEach((e) => { e.hidden = !page.picture; });
    new MutationObserver(() => { page.sonogramAt = 0; draw(); }).observe(document.body, { attributes: true, attributeFilter: ["class"] });
  }
  const hello = () => {
    if (typeof emitEvent === "function" && window.socket?.connected && $("st-run-go")) {
      emitEvent("stridor-run-hello", {});
      page.ready = true;
      $("st-run-go").addEventListener("click", () => { running(true); emitEvent("stridor-run", {}); });
      $("st-run-stop").addEventListener("click", () => emitEvent("stridor-run-stop", {}));
      $("st-run-listen").addEventListener("click", () => (page.sound ? silence() : listen()));
    } else setTimeout(hello, 30);
  };
  setTimeout(hello, 0);
  // What the limit cycles below are drawn with, too.
  const tools = { text, clear, shown, axes, round, title, legend, strips, length };
  return { page, start, show, begin, stale, tools };
})();
