// Draws the figures in the colours of the reader's system, and again when it changes.
const dark = window.matchMedia("(prefers-color-scheme: dark)");
const partner = JSON.parse(document.getElementById("dark-colours").textContent);

function draw() {
  for (const place of document.querySelectorAll(".plot")) {
    let text = document.getElementById(place.dataset.figure).textContent;
    if (dark.matches) text = text.replace(/#[0-9a-f]{6}\b/g, (colour) => partner[colour] ?? colour);
    const { data, layout } = JSON.parse(text);
    Plotly.react(place, data, layout, {
      responsive: true, displaylogo: false, scrollZoom: false,
      modeBarButtonsToRemove: ["select2d", "lasso2d"],
    });
  }
}

dark.addEventListener("change", draw);
draw();
