// Page: unpacks what it holds and draws plot after plot, so that it can be scrolled meanwhile.

const PAPER = 690; // px; what a sheet of A4 or letter is wide between its margins
const errors = [];
window.addEventListener("error", (event) => tell(event.message));
window.addEventListener("unhandledrejection", (event) => tell(String(event.reason)));

function tell(text) {
  errors.push(text);
  document.getElementById("errors").textContent = "Not everything could be drawn: " + errors.join("; ");
  document.body.dataset.errors = errors.join("; ");
}

async function drawPage() {
  for (const table of document.querySelectorAll("details.table")) table.open = false; // open where no script runs
  const page = JSON.parse(document.getElementById("page-data").textContent);
  const recordings = page.recordings.map((facts, i) => new Recording(facts, document.getElementById(`times-${i}`)));
  for (const figure of page.figures) recordings[figure.recording].begin(figure.layout);
  await run("plotly");
  const arrays = await Promise.all(page.arrays.map(unpacked));
  const plots = [];
  for (const figure of page.figures) {
    const recording = recordings[figure.recording];
    let plot;
    try {
      plot = new Plot(figure, arrays, recording);
      await plot.draw();
      if (plot.place.querySelector(".no-webgl")) throw new Error("no WebGL");
      document.body.dataset.drawn = String(Number(document.body.dataset.drawn) + 1);
    } catch (error) { tell(`${figure.id}: ${error}`); continue; }
    plots.push(plot);
    recording.plots.push(plot);
    await new Promise((resolve) => setTimeout(resolve, 0));
  }
  const sketch = () => recordings.forEach((recording) => recording.bar && recording.sketch());
  recordings.forEach((recording) => recording.tell(recording.range));
  sketch();
  window.addEventListener("resize", sketch);
  window.addEventListener("beforeprint", () => plots.forEach(({ place }) => place.style.setProperty("--fit", Math.min(1, PAPER / place.clientWidth))));
  NARROW.addEventListener("change", () => plots.forEach((plot) => plot.refit()));
  document.body.dataset.finished = "yes";
}

drawPage().catch((error) => tell(String(error)));
