// Chromium keeps the shape of every word that a canvas has measured until that canvas has been shown or is gone. ECharts
// measures all words on one canvas that is never shown, and numbers make new words with every move of a slider: without
// this the page grows by some 12 MB in an hour of moves.
import("nicegui-echart").then(({ echarts }) => {
  const WORDS = 200; // until a canvas is thrown away: what its shapes take stays below 0.3 MB
  let context = null, font = null, left = 0;
  const measureText = (words, wanted) => {
    if (left-- <= 0) [context, font, left] = [document.createElement("canvas").getContext("2d"), null, WORDS];
    if (wanted !== font) context.font = font = wanted || "12px sans-serif"; // ECharts' own when it names none
    return context.measureText(words);
  };
  echarts.setPlatformAPI({ measureText });
});
