"use strict";
// Both approaches side by side: a table as the report has it, and how far its making is.
const stridorBoth = (() => {
  const $ = (id) => document.getElementById(id);
  const page = { mu: null, what: "compare" };
  const said = (words) => { $("st-both-said").textContent = words; };
  function running(on) {
    $("st-both-go").disabled = on;
    $("st-both-report").disabled = on;
    $("st-both-stop").disabled = !on;
  }
  const cell = (name, words, attributes = {}) => {
    const made = document.createElement(name);
    made.textContent = words;
    for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
    return made;
  };
  const line = (cells) => { const row = document.createElement("tr"); row.append(...cells); return row; };
  // One block for each quantity: the column is narrow.
  function table(given) {
    const made = document.createElement("table"), body = document.createElement("tbody");
    made.append(cell("caption", given.title), body);
    for (const row of given.rows) {
      const [name, ...values] = row.cells;
      body.append(line([cell("th", name, { scope: "rowgroup", colspan: 2 })]));
      values.forEach((value, k) => {
        if (!value) return;
        const head = given.heads[k + 1] || "verdict";
        body.append(line([cell("th", head, { scope: "row", class: "st-both-of" }), cell("td", value, { class: head === "verdict" ? `st-both-${row.kind || "plain"}` : "" })]));
      });
    }
    return made;
  }
  function ended(c) {
    running(false);
    if (c.tables) $("st-both-tables").replaceChildren(...c.tables.map(table));
    said(page.what === "report" ? `${c.sentence[0].toUpperCase()}${c.sentence.slice(1)} and saved.` : c.sentence);
  }
  const parts = {
    waiting: (place) => said(`Waiting for its turn: number ${place} in the queue.`),
    begun: () => said(page.what === "report" ? "Everything is being computed …" : "Both approaches are being computed …"),
    log: (words) => said(words),
    done: ended,
    stopped(c) { running(false); said(c.sentence); },
    refused(words) { running(false); said(words); },
    failed(words) { running(false); said(words); },
  };
  const show = (part, content) => parts[part]?.(content);
  function begin(mu, what) {
    Object.assign(page, { mu, what });
    if (what === "compare") { $("st-both-tables").replaceChildren(); stale(false); }
    running(true);
    said("Starting …");
  }
  function stale(is) {
    $("st-both-title").textContent = is ? "Do both approaches agree? The numbers have changed since" : "Do both approaches agree?";
  }
  const ready = () => {
    if (typeof emitEvent !== "function" || !window.socket?.connected || !$("st-both-go")) { setTimeout(ready, 30); return; }
    for (const [id, name] of [["go", "stridor-compare"], ["report", "stridor-report"], ["stop", "stridor-compare-stop"]]) $(`st-both-${id}`).addEventListener("click", () => { running(true); emitEvent(name, {}); });
    page.ready = true;
  };
  setTimeout(ready, 0);
  return { page, show, begin, stale };
})();
