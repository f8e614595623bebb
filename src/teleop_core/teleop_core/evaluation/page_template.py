"""Page template: style and script of the report page, which is one file and asks nobody."""

# The browser itself refuses every request; plotly.js compiles its shaders at run time.
POLICY = (
    "default-src 'none'; script-src 'unsafe-inline' 'unsafe-eval'; style-src 'unsafe-inline'; "
    "img-src data: blob:; font-src data:; worker-src blob:"
)

STYLE = """\
:root { color-scheme: light; --line: #dfe3e8; --soft: #5c6670; --good: #2b8a3e; --bad: #c92a2a; }
body { margin: 0; background: #f5f6f8; color: #1c2126;
  font: 16px/1.5 system-ui, "Segoe UI", Roboto, "Helvetica Neue", Arial, sans-serif; }
main { max-width: 1180px; margin: 0 auto; padding: 24px 20px 60px; }
h1 { font-size: 1.7rem; margin: 0 0 4px; }
h2 { font-size: 1.35rem; margin: 44px 0 2px; }
h3 { font-size: 1.02rem; margin: 0; }
p.facts { color: var(--soft); margin: 0 0 16px; }
nav a { margin-right: 16px; }
a { color: #1864ab; }
.card { background: #fff; border: 1px solid var(--line); border-radius: 8px; padding: 14px 18px;
  margin: 16px 0; overflow-x: auto; }
figure figcaption { color: var(--soft); font-size: 0.93rem; margin: 2px 0 6px; }
table { border-collapse: collapse; font-size: 0.93rem; font-variant-numeric: tabular-nums; }
th, td { padding: 3px 14px 3px 0; text-align: right; white-space: nowrap; vertical-align: bottom; }
th:first-child, td:first-child, td.unit { text-align: left; }
td.unit, td.published, thead small { color: var(--soft); font-weight: normal; }
thead th { border-bottom: 2px solid var(--line); }
tr.group th { padding-top: 12px; text-align: left; border-bottom: 1px solid var(--line); }
td.met::after { content: " ✓"; color: var(--good); }
td.missed::after { content: " ✗"; color: var(--bad); }
td.value { font-weight: 600; }
td.plain::after { content: " ✓"; visibility: hidden; }
.error { color: var(--bad); }
@media print { .card { break-inside: avoid; } }
"""

# Arrays come once, as base64 of little-endian float32, and are named by their place in the list.
# Plots are drawn one after the other, so that the page can be scrolled meanwhile.
SCRIPT = """\
"use strict";
(function () {
  const errors = [];
  window.addEventListener("error", (event) => tell(event.message));
  window.addEventListener("unhandledrejection", (event) => tell(String(event.reason)));
  function tell(text) {
    errors.push(text);
    const line = document.getElementById("errors");
    line.textContent = "Not everything could be drawn: " + errors.join("; ");
    document.body.dataset.errors = errors.join("; ");
  }
  const page = JSON.parse(document.getElementById("page-data").textContent);
  const arrays = page.arrays.map((text) => {
    const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
    return new Float32Array(bytes.buffer);
  });
  const common = {
    font: { family: "system-ui, Segoe UI, Roboto, Arial, sans-serif", size: 13, color: "#1c2126" },
    margin: { l: 64, r: 16, t: 34, b: 48 }, paper_bgcolor: "#fff", plot_bgcolor: "#fff",
    legend: { orientation: "h", x: 0, y: 1.02, yanchor: "bottom" },
  };
  const axis = { gridcolor: "#e9ecef", zerolinecolor: "#ced4da", linecolor: "#adb5bd",
    showline: true, ticks: "outside", automargin: true };
  const axis3 = { gridcolor: "#dee2e6", backgroundcolor: "#fff", zeroline: false };
  function draw(index) {
    if (index === page.figures.length) {
      document.body.dataset.finished = "yes";
      return;
    }
    const figure = page.figures[index], place = document.getElementById(figure.id);
    for (const trace of figure.traces)
      for (const key of ["x", "y", "z"]) if (key in trace) trace[key] = arrays[trace[key]];
    const layout = Object.assign({}, common, figure.layout);
    for (const key of Object.keys(layout))
      if (/^[xy]axis/.test(key)) layout[key] = Object.assign({}, axis, layout[key]);
    if (layout.scene)
      for (const key of ["xaxis", "yaxis", "zaxis"])
        layout.scene[key] = Object.assign({}, axis3, layout.scene[key]);
    const options = { responsive: true, displaylogo: false, displayModeBar: "hover" };
    Promise.resolve()
      .then(() => Plotly.newPlot(place, figure.traces, layout, options))
      .then(() => {
        if (place.querySelector(".no-webgl")) tell("no WebGL for " + figure.id);
        else document.body.dataset.drawn = String(Number(document.body.dataset.drawn) + 1);
      })
      .catch((error) => tell(figure.id + ": " + error))
      .finally(() => setTimeout(() => draw(index + 1), 0));
  }
  draw(0);
})();
"""

PAGE = """\
<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="{policy}">
<meta name="viewport" content="width=device-width, initial-scale=1">
<link rel="icon" href="data:,">
<title>{title}</title>
<style>
{style}</style>
</head>
<body data-drawn="0">
<main>
<p id="errors" class="error"></p>
{body}
</main>
<script id="page-data" type="application/json">{data}</script>
<script>{plotly}</script>
<script>
{script}</script>
</body>
</html>
"""
