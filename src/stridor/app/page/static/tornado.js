"use strict";
// Sensitivities of a mode of a large model, which take a while: asked for by a button. What they are is drawn by page.js.
const stridorTornado = (() => {
  const $ = (id) => document.getElementById(id);
  const page = {};
  const said = (words) => { $("st-tornado-said").textContent = words; };
  const about = (s) => (s < 90 ? `${Number(Math.max(s, 1).toPrecision(1))} s` : `${Math.max(Math.round(s / 60), 2)} min`);
  function running(on) {
    $("st-tornado-go").hidden = on;
    $("st-tornado-stop").hidden = !on;
  }
  function offer(seconds) {
    $("st-tornado-ask").hidden = false;
    $("st-tornado-go").textContent = `Sensitivities of this mode (takes about ${about(seconds)})`;
    running(false);
    said("");
  }
  function hide() { $("st-tornado-ask").hidden = true; }
  function over(words) { running(false); said(words); }
  const parts = {
    waiting: (place) => said(`Waiting for its turn: number ${place} in the queue.`),
    begun: () => said("Starting …"),
    log: (words) => said(`${words[0].toUpperCase()}${words.slice(1)} …`),
    tornado: (c) => stridor.show("tornado", c, document.body.classList.contains("st-busy")),
    done: hide,
    stopped: (c) => over(`${c.sentence[0].toUpperCase()}${c.sentence.slice(1)}.`),
    refused: over, failed: over,
  };
  const show = (part, content) => parts[part]?.(content);
  const ready = () => {
    if (typeof emitEvent !== "function" || !window.socket?.connected || !$("st-tornado-go")) { setTimeout(ready, 30); return; }
    $("st-tornado-go").addEventListener("click", () => { running(true); said("Starting …"); emitEvent("stridor-sensitivities", {}); $("st-tornado-stop").focus(); });
    $("st-tornado-stop").addEventListener("click", () => { emitEvent("stridor-sensitivities-stop", {}); });
    page.ready = true;
  };
  setTimeout(ready, 0);
  return { page, offer, hide, show };
})();
