// Recording: the visible time that all of its plots share, with a strip and fields to choose it.


const NARROWEST = 0.002; // s; two samples at 1 kHz

class Recording {
  constructor({ duration, bands, kept }, bar) {
    this.whole = [0, duration];
    this.range = this.whole;
    this.bands = bands;
    this.kept = kept; // s; length of the stretches of which extremes are kept, 0 for all samples
    this.plots = [];
    this.bar = bar;
    if (bar) this.control();
  }

  // What is shown first is the range of the first time axis that has one.
  begin(layout) {
    const axis = Object.entries(layout).find(([key, value]) => /^xaxis/.test(key) && value.uirevision === TIME && value.range);
    if (axis && this.range === this.whole) this.range = [...axis[1].range];
  }

  // Show a range in all plots, those that are seen first.
  show([begin, end]) {
    const [first, last] = this.whole, width = Math.min(Math.max(end - begin, NARROWEST), last - first);
    const from = Math.min(Math.max(begin, first), last - width);
    this.range = [from, from + width];
    this.tell(this.range);
    const middle = window.innerHeight / 2;
    const distance = (plot) => {
      const { top, bottom } = plot.place.getBoundingClientRect();
      return top <= middle && bottom >= middle ? 0 : Math.min(Math.abs(top - middle), Math.abs(bottom - middle));
    };
    this.waiting = this.plots.filter((plot) => plot.dependsOnTime).sort((a, b) => distance(a) - distance(b));
    if (!this.isBusy) this.next();
  }

  // One plot after the other, so that the page answers meanwhile; a newer range takes over.
  async next() {
    const plot = this.waiting.shift();
    this.isBusy = Boolean(plot);
    this.bar.dataset.busy = this.isBusy ? "yes" : "";
    if (!plot) return;
    try { await plot.update(this.range); } catch (error) { tell(`${plot.figure.id}: ${error}`); }
    setTimeout(() => this.next(), 0);
  }

  tell([begin, end]) {
    if (!this.bar) return;
    const digits = end - begin < 0.1 ? 4 : end - begin < 30 ? 3 : 1;
    for (const [name, value] of [["from", begin], ["to", end]]) {
      const field = this.bar.querySelector(`.${name}`);
      if (field !== document.activeElement || !field.matches(".changing")) field.value = value.toFixed(digits);
    }
    const length = this.whole[1] - this.whole[0], view = this.bar.querySelector(".view");
    view.style.left = `${(100 * (begin - this.whole[0])) / length}%`;
    view.style.width = `${(100 * (end - begin)) / length}%`;
    this.bar.querySelector(".told").textContent = this.words([begin, end]);
  }

  // What is drawn: samples, or extremes of how many.
  words(range) {
    const plot = this.plots.find((candidate) => candidate.curves.length);
    if (!plot) return "";
    const times = plot.curves[0].times, [from, to] = within(times, range);
    if (to - from < 2) return "no samples here";
    const room = Math.max(300, plot.place.clientWidth || 1000), apart = (times[to - 1] - times[from]) / (to - from - 1);
    const kept = this.kept ? `smallest and largest value of each ${told(this.kept)}, all that the page holds` : `every sample, ${told(apart)} apart`;
    return to - from <= 2 * room ? kept : `smallest and largest of each ${told((range[1] - range[0]) / room)}; zoom in for more`;
  }

  move(share) {
    const [begin, end] = this.range, step = share * (end - begin);
    this.show([begin + step, end + step]);
  }

  zoom(factor) {
    const [begin, end] = this.range, middle = (begin + end) / 2, half = (factor * (end - begin)) / 2;
    this.show([middle - half, middle + half]);
  }

  control() {
    const acts = { earlier: () => this.move(-0.8), later: () => this.move(0.8), closer: () => this.zoom(0.4),
      further: () => this.zoom(2.5), all: () => this.show(this.whole) };
    for (const [name, act] of Object.entries(acts)) this.bar.querySelector(`.${name}`).addEventListener("click", act);
    for (const field of this.bar.querySelectorAll("input")) {
      field.addEventListener("input", () => field.classList.add("changing"));
      field.addEventListener("change", () => {
        field.classList.remove("changing");
        const ends = ["from", "to"].map((name) => Number(this.bar.querySelector(`.${name}`).value));
        this.show(ends[1] > ends[0] ? ends : this.range);
      });
    }
    const keys = { ArrowLeft: () => this.move(-0.1), ArrowRight: () => this.move(0.1), ArrowUp: acts.closer,
      ArrowDown: acts.further, Home: acts.all };
    const strip = this.bar.querySelector(".strip");
    strip.addEventListener("keydown", (event) => { if (keys[event.key]) { keys[event.key](); event.preventDefault(); } });
    strip.addEventListener("dblclick", acts.all);
    strip.addEventListener("pointerdown", (event) => this.drag(strip, event));
    this.bar.hidden = false;
  }

  // Drag the window or one of its ends; elsewhere the window comes to the pointer.
  drag(strip, event) {
    const box = strip.getBoundingClientRect(), length = this.whole[1] - this.whole[0];
    const timeAt = (x) => this.whole[0] + (length * (x - box.left)) / box.width;
    const grip = (10 * length) / box.width, at = timeAt(event.clientX);
    let [begin, end] = this.range;
    const near = [begin, end].map((edge) => Math.abs(edge - at));
    const isWhole = end - begin >= length;
    const edge = Math.min(...near) < grip ? (near[0] < near[1] ? 0 : 1) : -1;
    if (edge < 0 && !isWhole && (at < begin || at > end)) {
      this.show([at - (end - begin) / 2, at + (end - begin) / 2]);
      [begin, end] = this.range;
    }
    const wanted = (x) => {
      const moved = timeAt(x) - at;
      if (edge < 0 && isWhole) return [Math.min(at, at + moved), Math.max(at, at + moved)]; // choose a part
      if (edge < 0) return [begin + moved, end + moved];
      return edge ? [begin, Math.max(end + moved, begin + NARROWEST)] : [Math.min(begin + moved, end - NARROWEST), end];
    };
    const follow = (moving) => { if (Math.abs(moving.clientX - event.clientX) > 2) this.show(wanted(moving.clientX)); };
    strip.setPointerCapture(event.pointerId);
    strip.addEventListener("pointermove", follow);
    strip.addEventListener("pointerup", () => strip.removeEventListener("pointermove", follow), { once: true });
  }

  // Bands and the first curve over the whole time.
  sketch() {
    const canvas = this.bar.querySelector("canvas"), pixels = window.devicePixelRatio || 1;
    const width = (canvas.width = canvas.clientWidth * pixels), height = (canvas.height = canvas.clientHeight * pixels);
    const pen = canvas.getContext("2d"), length = this.whole[1] - this.whole[0];
    const across = (time) => (width * (time - this.whole[0])) / length;
    for (const band of this.bands) {
      pen.fillStyle = band.color;
      pen.globalAlpha = 0.35;
      for (const [from, to] of joined(band.stretches, this.whole, length / width))
        pen.fillRect(across(from), 0, Math.max(1, across(to) - across(from)), height);
    }
    const plot = this.plots.find((candidate) => candidate.curves.length);
    if (!plot) return;
    const curve = plot.curves[plot.curves.length > 2 ? 2 : 0];
    const { x, y } = thinned(curve.times, curve.values, 0, curve.times.length, Math.round(width));
    const known = y.filter(Number.isFinite), low = known.reduce((a, b) => Math.min(a, b), Infinity);
    const high = known.reduce((a, b) => Math.max(a, b), -Infinity), span = high - low || 1;
    pen.globalAlpha = 1; pen.strokeStyle = "#868e96"; pen.beginPath();
    y.forEach((value, i) => { if (Number.isFinite(value)) pen.lineTo(across(x[i]), height * (0.9 - (0.8 * (value - low)) / span)); });
    pen.stroke();
  }
}

function told(seconds) {
  return seconds < 1 ? `${Number((1e3 * seconds).toPrecision(2))} ms` : `${Number(seconds.toPrecision(2))} s`;
}
