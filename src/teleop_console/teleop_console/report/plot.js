// Plot: one figure of the page, with what of it depends on the visible time.

const TIME = "time"; // the mark of axes of time, as figure.py has it
const NARROW = window.matchMedia("(max-width: 640px)");
const FEW = 200; // samples that are drawn as dots too
const AXIS = { showline: true, ticks: "outside", automargin: true };

class Plot {
  constructor(figure, arrays, recording) {
    this.figure = figure;
    this.place = document.getElementById(figure.id);
    this.recording = recording;
    this.arrays = arrays;
    this.layout = laidOut(resolved(figure.layout, arrays));
    // Axes that time_axis() of figure.py made.
    this.axes = Object.keys(this.layout).filter((key) => /^xaxis/.test(key) && this.layout[key].uirevision === TIME);
    this.traces = resolved(figure.traces, arrays).map(seen);
    this.curves = []; this.paths = [];
    this.faded = this.traces.flatMap((trace, index) => (trace.meta && trace.meta.surrounds ? [index] : []));
    this.traces.forEach((trace, index) => {
      const axis = "xaxis" + (trace.xaxis || "x").slice(1);
      if (trace.meta && trace.meta.path)
        this.paths.push({ index, times: trace.customdata, during: trace.meta.during, colored: trace.meta.colored,
          isWhole: trace.meta.whole, places: [trace.x, trace.y, trace.z].filter(Boolean) });
      else if (trace.type === "scatter" && this.axes.includes(axis) && trace.x && trace.x.length)
        this.curves.push({ index, times: trace.x, values: trace.y, mode: trace.mode || "lines" });
    });
  }

  get isTimed() { return this.axes.length > 0; }
  get dependsOnTime() { return this.isTimed || this.paths.length > 0; }

  async draw() {
    this.place.textContent = "";
    this.fit();
    const options = { responsive: true, displaylogo: false, displayModeBar: NARROW.matches ? false : "hover",
      doubleClickDelay: 500, doubleClick: this.isTimed ? false : "reset+autosize" };
    const range = this.recording.range;
    this.show(range, (index, changes) => {
      for (const [key, value] of Object.entries(changes)) {
        const [name, part] = key.split(".");
        if (part) this.traces[index][name] = { ...this.traces[index][name], [part]: value };
        else this.traces[index][name] = value;
      }
    }, (changes) => { for (const [key, value] of Object.entries(changes)) put(this.layout, key.split("."), value); });
    if (this.isTimed && this.recording.bands.length) this.layout.showlegend = true;
    await Plotly.newPlot(this.place, this.traces, this.layout, options);
    this.shown = range;
    if (this.isTimed) this.listen();
  }

  listen() {
    const changed = (change) => {
      for (const axis of this.axes) {
        const ends = change[`${axis}.range`] || [change[`${axis}.range[0]`], change[`${axis}.range[1]`]];
        if (change[`${axis}.autorange`]) return this.recording.whole;
        if (ends[0] !== undefined && ends[1] !== undefined) return ends.map(Number);
      }
      return null;
    };
    this.place.on("plotly_relayout", (change) => {
      const range = changed(change);
      if (range) { this.shown = null; this.recording.show(range); }
    });
    this.place.on("plotly_relayouting", (change) => {
      const range = changed(change);
      if (range) this.recording.tell(range);
    });
    this.place.on("plotly_doubleclick", () => {
      const free = {};
      for (const key of Object.keys(this.layout)) if (/^yaxis/.test(key)) free[`${key}.autorange`] = true;
      this.shown = null;
      Plotly.relayout(this.place, free).then(() => this.recording.show(this.recording.whole));
    });
  }

  // Hand over what changes with the visible time: of traces, and of the layout.
  show(range, trace, layout) {
    const width = this.place.clientWidth || 1000;
    const closer = {};
    for (const curve of this.curves) {
      const [from, to] = within(curve.times, range);
      const mode = to - from <= FEW && to - from < width / 4 ? "lines+markers" : curve.mode;
      trace(curve.index, { ...thinned(curve.times, curve.values, from, to, Math.max(300, width)), mode });
    }
    for (const path of this.paths) {
      const { times, places } = pathWithin(path, path.isWhole ? this.recording.whole : range);
      const changes = { customdata: times };
      places.forEach((values, axis) => { changes["xyz"[axis]] = values; });
      if (path.colored) Object.assign(changes, { "line.color": times.map((time) => Number.isNaN(time) ? range[0] : time), "line.cmin": range[0], "line.cmax": range[1] });
      if (!path.isWhole) changes.opacity = opacityOf(places);
      trace(path.index, changes);
      if (!path.isWhole) this.come(path, extents(places), closer);
    }
    for (const index of this.faded) trace(index, { opacity: this.isClose ? 0.3 : 1 });
    layout({ ...(this.isTimed ? this.timeLayout(range, width) : {}), ...closer });
  }

  // Come closer to a short part of a path, and go back for a long one.
  come(path, part, changes) {
    path.extents ||= extents(pathWithin(path, this.recording.whole).places);
    const ranges = closeUp(part, path.extents), trace = this.traces[path.index];
    this.isClose = Boolean(ranges);
    const names = path.places.length === 3 ? ["scene.xaxis", "scene.yaxis", "scene.zaxis"]
      : [`xaxis${(trace.xaxis || "x").slice(1)}`, `yaxis${(trace.yaxis || "y").slice(1)}`];
    names.forEach((name, axis) => {
      const own = name.split(".").reduce((part, key) => (part || {})[key], this.figure.layout);
      if (ranges) changes[`${name}.range`] = ranges[axis];
      else if (own && own.range) changes[`${name}.range`] = [...own.range];
      else changes[`${name}.autorange`] = true;
    });
  }

  timeLayout(range, width) {
    const changes = {}, pixel = (range[1] - range[0]) / width;
    for (const axis of this.axes) changes[`${axis}.range`] = [...range];
    if (this.recording.bands.length) {
      const own = this.figure.layout.shapes || [];
      const bands = this.axes.flatMap((axis, i) => bandShapes(this.recording.bands, this.band(axis), range, pixel, i === 0));
      changes.shapes = [...bands, ...own];
    }
    return changes;
  }

  // Where bands of a time axis stand: over the height of all rows if it is the only one.
  band(axis) {
    const x = axis.replace("axis", "");
    if (this.axes.length > 1) return { x, y: `${this.layout[axis].anchor || x.replace("x", "y")} domain`, height: [0, 1] };
    const rows = Object.entries(this.layout).filter(([key]) => /^yaxis/.test(key)).map(([, row]) => row.domain || [0, 1]);
    return { x, y: "paper", height: [Math.min(...rows.map((row) => row[0])), Math.max(...rows.map((row) => row[1]))] };
  }

  async update(range) {
    if (this.shown && this.shown[0] === range[0] && this.shown[1] === range[1]) return;
    const groups = new Map();
    let layout = {};
    this.show(range, (index, changes) => {
      const keys = Object.keys(changes).join();
      if (!groups.has(keys)) groups.set(keys, { indices: [], values: {} });
      const group = groups.get(keys);
      group.indices.push(index);
      for (const [key, value] of Object.entries(changes)) (group.values[key] ||= []).push(value);
    }, (changes) => { layout = changes; });
    this.shown = range;
    for (const { indices, values } of groups.values()) {
      await Plotly.update(this.place, values, layout, indices);
      layout = {};
    }
  }

  // Plots side by side stand below each other where there is no room.
  fit() {
    const grid = this.figure.layout.grid, height = this.figure.layout.height;
    this.layout.margin = NARROW.matches ? { l: 56, r: 8, t: 30, b: 44 } : { l: 76, r: 16, t: 34, b: 48 };
    this.layout.font = { ...this.layout.font, size: NARROW.matches ? 11 : 13 };
    if (!grid || !(grid.columns > 1)) return;
    this.layout.grid = NARROW.matches ? { ...grid, rows: grid.columns * grid.rows, columns: 1 } : { ...grid };
    this.layout.height = NARROW.matches ? height * grid.columns * 0.85 : height;
    this.place.style.height = `${this.layout.height}px`;
  }

  // Draw anew: axes keep the places that they once had.
  async refit() {
    Plotly.purge(this.place);
    this.layout = laidOut(resolved(this.figure.layout, this.arrays));
    await this.draw();
  }
}

// The same with arrays in place of { array: number }.
function resolved(tree, arrays) {
  if (Array.isArray(tree)) return tree.map((branch) => resolved(branch, arrays));
  if (tree === null || typeof tree !== "object") return tree;
  const keys = Object.keys(tree);
  if (keys.length === 1 && typeof tree.array === "number") return arrays[tree.array];
  return Object.fromEntries(keys.map((key) => [key, resolved(tree[key], arrays)]));
}

function put(target, [key, ...further], value) {
  if (further.length) put((target[key] ||= {}), further, value);
  else target[key] = value;
}

function laidOut(own) {
  const layout = { font: { size: 13 }, autotypenumbers: "strict", legend: { orientation: "h", x: 0, y: 1.02, yanchor: "bottom" }, ...own };
  for (const key of Object.keys(layout)) if (/^[xy]axis/.test(key)) layout[key] = { ...AXIS, ...layout[key] };
  if (layout.scene) layout.scene = { xaxis: {}, yaxis: {}, zaxis: {}, ...layout.scene };
  return themed(layout);
}
