"use strict";
// The map of stability: how many modes grow, the curves on which they begin to, and where the page is.
const stridorMap = (() => {
  const $ = (id) => document.getElementById(id);
  const page = { chart: null, colour: "#D55E00", numbers: [], asked: null, map: null, here: null, samples: null };
  const dark = () => document.body.classList.contains("body--dark");
  const text = () => (dark() ? "#d8d8d8" : "#222"), grid = () => (dark() ? "#33373e" : "#e4e4e4"), rule = () => (dark() ? "#5a5e66" : "#999");
  const chart = () => getElement(page.chart)?.chart;
  const shown = (v) => (v === 0 ? "0" : Math.abs(v) < 1e-3 || Math.abs(v) >= 1e5 ? v.toExponential(2).replace(/\.?0+e/, "e").replace("e+", "e").replace("-", "−") : String(Number(v.toPrecision(4))).replace("-", "−"));
  const named = (path) => page.numbers.find((n) => n.path === path) ?? { words: path, unit: "" };
  const label = (n) => (n.unit ? `${n.words} [${n.unit}]` : n.words);
  const said = (words) => { $("st-map-said").textContent = words; };
  function running(on) { $("st-map-go").disabled = on; $("st-map-stop").disabled = !on; }

  function offer(numbers) {
    page.numbers = numbers;
    for (const [axis, first] of [["x", 0], ["y", 1]]) {
      const select = $(`st-map-${axis}`);
      select.replaceChildren(...numbers.map((n) => new Option(label(n), n.path)));
      const stiffness = numbers.findIndex((n) => n.path.endsWith(".stiffness") && n.path.startsWith("contacts"));
      select.selectedIndex = axis === "y" && stiffness > 0 ? stiffness : Math.min(first, numbers.length - 1);
      chosen(axis);
    }
  }
  function chosen(axis) {
    const n = page.numbers[$(`st-map-${axis}`).selectedIndex];
    if (!n) return;
    $(`st-map-${axis}-low`).value = shown(n.low).replace("−", "-");
    $(`st-map-${axis}-high`).value = shown(n.high).replace("−", "-");
    $(`st-map-${axis}-unit`).textContent = n.unit;
  }
  function ask() {
    const value = (id) => { const t = $(id).value.replace(",", ".").trim(); return t === "" || !Number.isFinite(Number(t)) ? null : Number(t); };
    page.asked = { x: $("st-map-x").value, y: $("st-map-y").value, x_range: [value("st-map-x-low"), value("st-map-x-high")], y_range: [value("st-map-y-low"), value("st-map-y-high")] };
    running(true);
    emitEvent("stridor-map", page.asked);
  }

  // Samples of a study: the first two of its numbers, until others are chosen.
  function samples(given) {
    page.samples = given;
    const paths = Object.keys(given.numbers), [x, y] = [paths[0], paths[1] ?? paths[0]];
    for (const path of paths) {
      if (!page.numbers.some((n) => n.path === path)) {
        page.numbers.push({ path, words: path, unit: "", low: 0, high: 1 });
        for (const axis of ["x", "y"]) $(`st-map-${axis}`).append(new Option(path, path));
      }
      const n = named(path), values = given.numbers[path];
      Object.assign(n, { low: Math.min(...values), high: Math.max(...values) });
      if (n.low === n.high) Object.assign(n, { low: n.low - 0.5 * (Math.abs(n.low) || 1), high: n.high + 0.5 * (Math.abs(n.high) || 1) });
    }
    [["x", x], ["y", y]].forEach(([axis, path]) => { $(`st-map-${axis}`).value = path; chosen(axis); });
    sampled();
    const grow = given.grows.filter(Boolean).length;
    said(`Study ${given.name}: something grows at ${grow} of ${given.grows.length} samples.${given.left ? ` ${given.left}.` : ""} A click on a sample takes the bench to all of its numbers; "Draw map" traces the curves.`);
  }
  function sampled() {
    const x = $("st-map-x").value, y = $("st-map-y").value;
    if (!page.samples || !(x in page.samples.numbers) || !(y in page.samples.numbers)) return;
    const ends = (path) => [named(path).low, named(path).high];
    page.asked = { x, y, x_range: ends(x), y_range: ends(y) };
    page.map = { xs: [], ys: [], counts: [], curves: [] };
    page.here = null;
    draw();
  }
  const points = (grow) => {
    const { x, y } = page.asked, s = page.samples;
    if (!s || !(x in s.numbers) || !(y in s.numbers)) return [];
    return s.grows.flatMap((g, k) => (g === grow ? [[s.numbers[x][k], s.numbers[y][k], k]] : []));
  };
  function nearest(pixel) {
    let found = null, least = 12;
    for (const [x, y, k] of [...points(true), ...points(false)]) {
      const [a, b] = chart().convertToPixel({ gridIndex: 0 }, [x, y]), away = Math.hypot(a - pixel[0], b - pixel[1]);
      if (away < least) [least, found] = [away, k];
    }
    return found;
  }

  // How many grow: nothing is paper, each one more is darker; what failed or is not known is grey.
  function shading(m) {
    const canvas = document.createElement("canvas"), width = m.xs.length, height = m.ys.length;
    Object.assign(canvas, { width, height });
    const context = canvas.getContext("2d"), image = context.createImageData(width, height), rgb = [1, 3, 5].map((k) => parseInt(page.colour.slice(k, k + 2), 16));
    m.counts.forEach((column, i) => column.forEach((n, j) => {
      const o = 4 * ((height - 1 - j) * width + i), colour = n < 0 ? [128, 128, 128] : rgb;
      for (let c = 0; c < 3; c++) image.data[o + c] = colour[c];
      image.data[o + 3] = n === 0 ? 0 : n < 0 ? 90 : Math.min(40 + 45 * n, 220);
    }));
    context.putImageData(image, 0, 0);
    // Cells with sharp edges: nothing is known between their middles.
    const large = document.createElement("canvas"), factor = Math.ceil(1200 / Math.max(width, height));
    Object.assign(large, { width: factor * width, height: factor * height });
    const drawn = large.getContext("2d");
    drawn.imageSmoothingEnabled = false;
    drawn.drawImage(canvas, 0, 0, large.width, large.height);
    return large;
  }
  const RAMP = ["#440154", "#3b528b", "#21918c", "#5ec962", "#b5a519"], NIGHT = ["#c07be0", "#8ea6ee", "#4fd0c8", "#7ee081", "#fde725"];
  function draw() {
    const m = page.map, c = chart();
    if (!m || !c) return;
    c.getDom().hidden = false;
    const nx = named(page.asked.x), ny = named(page.asked.y), image = m.xs.length ? shading(m) : null, [x0, x1] = page.asked.x_range, [y0, y1] = page.asked.y_range;
    const half = (v) => (v.length > 1 ? (v[1] - v[0]) / 2 : 0), hues = [...new Set(m.curves.map((k) => Math.round(k.frequency_hz)))].sort((a, b) => a - b);
    const hue = (f) => (dark() ? NIGHT : RAMP)[hues.length < 2 ? 2 : Math.round((4 * hues.indexOf(Math.round(f))) / (hues.length - 1))];
    const words = (k) => (k.kind === "divergence" ? "divergence, 0 Hz" : k.frequency_hz < 1e3 ? `${k.frequency_hz.toPrecision(3)} Hz` : `${(k.frequency_hz / 1e3).toPrecision(3)} kHz`), l = { color: text(), fontSize: 11 };
    c.setOption({ animation: false, backgroundColor: "transparent",
      grid: { left: 90, right: 24, top: 40, bottom: 48, outerBoundsMode: "none" },
      legend: { top: 4, icon: "rect", itemHeight: 4, textStyle: l, selectedMode: false, data: [...new Set(m.curves.map(words)), ...(points(true).length ? ["sample: grows"] : []), ...(points(false).length ? ["sample: nothing grows"] : [])] },
      xAxis: { type: "value", min: x0, max: x1, name: label(nx), nameLocation: "middle", nameGap: 28, nameTextStyle: l, axisLabel: { ...l, formatter: shown, hideOverlap: true }, axisLine: { onZero: false, lineStyle: { color: rule() } }, splitLine: { lineStyle: { color: grid() } } },
      yAxis: { type: "value", min: y0, max: y1, name: label(ny), nameLocation: "middle", nameGap: 68, nameTextStyle: l, axisLabel: { ...l, formatter: shown }, axisLine: { show: true, onZero: false, lineStyle: { color: rule() } }, splitLine: { lineStyle: { color: grid() } } },
      series: [
        { id: "counts", type: "custom", silent: true, clip: true, data: [0], encode: { x: -1, y: -1 }, z: 1, renderItem: (_, api) => {
          if (!image) return null;
          const [a, b] = api.coord([m.xs[0] - half(m.xs), m.ys[0] - half(m.ys)]), [d, e] = api.coord([m.xs[m.xs.length - 1] + half(m.xs), m.ys[m.ys.length - 1] + half(m.ys)]);
          return { type: "image", style: { image, x: a, y: e, width: d - a, height: b - e } };
        } },
        ...m.curves.map((k, i) => ({ id: `curve${i}`, name: words(k), type: "line", silent: true, showSymbol: false, z: 3, lineStyle: { width: 2, color: hue(k.frequency_hz) }, itemStyle: { color: hue(k.frequency_hz) }, data: k.x.map((x, j) => [x, k.y[j]]) })),
        ...[[true, "sample: grows", page.colour], [false, "sample: nothing grows", dark() ? "#5CB3E6" : "#0072B2"]].map(([grow, name, colour]) => ({ id: name, name, type: "scatter", symbolSize: 6, silent: true, z: 4, itemStyle: { color: colour, opacity: 0.8 }, data: points(grow) })),
        { id: "here", type: "scatter", symbol: "path://M-5,0L5,0M0,-5L0,5", symbolSize: 15, silent: true, z: 5, itemStyle: { color: "transparent", borderColor: text(), borderWidth: 2 }, data: page.here ? [page.here] : [] },
      ] }, { notMerge: true });
    c.getDom().setAttribute("role", "img");
    const most = m.counts.reduce((a, column) => Math.max(a, ...column), 0);
    c.getDom().setAttribute("aria-label", `Map of stability over ${label(nx)} and ${label(ny)}: ${m.curves.length} curves, up to ${most} modes grow. ${page.here ? `The bench is at ${shown(page.here[0])}, ${shown(page.here[1])}.` : ""}`);
  }

  // -- what the server says ----------------------------------------------------------------------------------------
  const failed = (words) => { running(false); said(words); };
  const parts = {
    waiting: (place) => said(`Waiting for its turn: number ${place} in the queue.`),
    begun: () => said("The first map is being made …"),
    log: (words) => said(`${words[0].toUpperCase()}${words.slice(1)} …`),
    map(m) { page.map = m; draw(); },
    done(c) { running(false); said(c.sentence); },
    stopped(c) { running(false); said("Stopped: the map is as far as it was."); },
    refused: failed, failed,
  };
  const show = (part, content) => parts[part]?.(content);
  function begin() { page.map = null; said("Starting …"); }
  function here(at, stale) {
    page.here = at.every((v) => typeof v === "number") ? at : null;
    draw();
    if (stale && !$("st-map-said").textContent.startsWith("Other numbers")) said(`Other numbers have changed since this map was made. ${$("st-map-said").textContent}`);
  }
  function clear() {
    Object.assign(page, { map: null, here: null });
    if (chart()) chart().getDom().hidden = true;
    running(false);
    said("Another case is open.");
  }
  function start(id, colour) {
    Object.assign(page, { chart: id, colour });
    const c = chart();
    c.getDom().hidden = !page.map;
    c.getZr().on("click", (event) => {
      const at = c.convertFromPixel({ gridIndex: 0 }, [event.offsetX, event.offsetY]);
      if (!page.map || !c.containPixel({ gridIndex: 0 }, [event.offsetX, event.offsetY])) return;
      const sample = nearest([event.offsetX, event.offsetY]);
      if (sample !== null) {
        emitEvent("stridor-map-sample", { row: sample });
        page.here = [page.samples.numbers[page.asked.x][sample], page.samples.numbers[page.asked.y][sample]];
        said(`Sample ${sample + 1}: ${page.samples.words[sample]}. The bench has its numbers now.`);
        draw();
      } else if (page.map.xs.length) goTo(at);
    });
    new MutationObserver(draw).observe(document.body, { attributes: true, attributeFilter: ["class"] });
    // By keyboard: arrows move by a hundredth of the range.
    c.getDom().tabIndex = 0;
    c.getDom().addEventListener("keydown", (event) => {
      const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowDown: [0, -1], ArrowUp: [0, 1] }[event.key];
      if (!step || !page.map || !page.here) return;
      event.preventDefault();
      goTo(page.here.map((v, k) => v + (step[k] * (page.asked[k ? "y_range" : "x_range"][1] - page.asked[k ? "y_range" : "x_range"][0])) / 100), true);
    });
  }
  // held: arrows in a row are one step for undo.
  function goTo(at, held = false) {
    const within = (v, [low, high]) => Math.min(Math.max(Number(v.toPrecision(5)), low), high);
    emitEvent("stridor-map-to", { x: within(at[0], page.asked.x_range), y: within(at[1], page.asked.y_range), held });
  }
  const hello = () => {
    if (typeof emitEvent === "function" && window.socket?.connected && $("st-map-go")) {
      emitEvent("stridor-map-hello", {});
      page.ready = true;
      for (const axis of ["x", "y"]) $(`st-map-${axis}`).addEventListener("change", () => { chosen(axis); sampled(); });
      $("st-map-go").addEventListener("click", ask);
      $("st-map-stop").addEventListener("click", () => emitEvent("stridor-map-stop", {}));
    } else setTimeout(hello, 60);
  };
  setTimeout(hello, 0);
  return { page, start, offer, samples, show, begin, here, clear };
})();
