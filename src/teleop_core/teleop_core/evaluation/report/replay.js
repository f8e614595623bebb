// Replay: the robot as it moved; its bodies are placed here, from the coordinates of their tree.

const TRAIL = 3; // s of the tip's path that are drawn
const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4, 10];
const FREE = 3, TURNS = 1, SLIDES = 2; // as Joint of bodies/body.py
const MM = 1e3;

class Replay extends Plot {
  constructor(figure, arrays, recording) {
    super(figure, arrays, recording);
    this.told = this.layout.meta;
    this.parts = { robot: [], trail: [], fixture: [] };
    this.traces.forEach(({ meta }, index) => { if (meta && meta.part) this.parts[meta.part].push(index); });
    this.outlines = this.parts.fixture.map((index) => ({ during: this.traces[index].meta.during,
      places: ["x", "y", "z"].map((axis) => this.traces[index][axis]) }));
    this.tips = new Map();
    this.time = this.first = this.told.begin;
    this.last = this.told.begin + this.told.step * (this.told.count - 1);
  }

  get dependsOnTime() { return true; }

  async draw() {
    delete this.layout.meta; // plotly.js would copy it
    this.coordinates ||= await Promise.all(this.told.coordinates.map(unpacked));
    this.free ||= await Promise.all(this.told.free.map(unpacked));
    await super.draw();
    if (!this.player) this.control();
    this.limit();
    await this.at(this.time);
  }

  async update(range) {
    await super.update(range);
    this.limit();
    if (!this.isPlaying) await this.at(this.time);
  }

  // The replay is of the visible time.
  limit() {
    const [begin, end] = this.recording.range;
    this.from = Math.min(Math.max(begin, this.first), this.last);
    this.to = Math.max(Math.min(end, this.last), this.from);
    this.time = Math.min(Math.max(this.time, this.from), this.to);
    Object.assign(this.player.querySelector("input"), { min: this.from, max: this.to });
  }

  control() {
    this.player = document.createElement("div");
    this.player.className = "player";
    this.player.innerHTML = '<button type="button"></button><input type="range" step="any" aria-label="time of the replay">' +
      `<output></output><select aria-label="speed">${SPEEDS.map((speed) =>
        `<option value="${speed}"${speed === 1 ? " selected" : ""}>${speed} ×</option>`).join("")}</select>`;
    this.place.after(this.player);
    this.player.querySelector("button").addEventListener("click", () => (this.isPlaying ? this.pause() : this.play()));
    this.player.querySelector("input").addEventListener("input", (event) => this.at(Number(event.target.value)));
    if (this.recording.bar) {
      this.now = document.createElement("div");
      this.now.className = "now";
      this.recording.bar.querySelector(".strip").append(this.now);
    }
    this.label();
  }

  label() {
    const button = this.player.querySelector("button");
    button.textContent = this.isPlaying ? "❚❚" : "▶";
    button.setAttribute("aria-label", this.isPlaying ? "pause" : "play");
  }

  pause() { this.isPlaying = false; this.label(); }

  async play() {
    if (this.time >= this.to) this.time = this.from;
    this.isPlaying = true;
    this.label();
    let before = performance.now();
    while (this.isPlaying) {
      await new Promise(requestAnimationFrame);
      const now = performance.now(), speed = Number(this.player.querySelector("select").value);
      const time = this.time + (speed * (now - before)) / 1000;
      before = now;
      if (time >= this.to) this.pause();
      await this.at(Math.min(time, this.to));
    }
  }

  // Draw a time; the newest that was asked for while another was being drawn comes next.
  async at(time) {
    this.time = time;
    this.tell();
    if (this.isDrawing) return;
    this.isDrawing = true;
    try {
      for (let drawn = NaN; drawn !== this.time;) await this.pose(drawn = this.time);
    } finally { this.isDrawing = false; }
  }

  tell() {
    this.player.querySelector("input").value = this.time;
    this.player.querySelector("output").textContent = `${this.time.toFixed(2)} s`;
    if (this.now) this.now.style.left = `${(100 * this.time) / this.recording.whole[1]}%`;
  }

  async pose(time) {
    const places = [this.corners(this.bodiesAt(this.momentOf(time))), this.trail(time)];
    for (const { during, places: outline } of this.outlines) {
      const isOn = during.some(([begin, end]) => begin <= time && time <= end);
      places.push(isOn ? outline : [[NaN], [NaN], [NaN]]);
    }
    const [x, y, z] = [0, 1, 2].map((axis) => places.map((place) => place[axis]));
    await Plotly.restyle(this.place, { x, y, z }, [...this.parts.robot, ...this.parts.trail, ...this.parts.fixture]);
    this.place.dataset.time = time;
  }

  momentOf(time) { return Math.min(Math.max((time - this.told.begin) / this.told.step, 0), this.told.count - 1); }

  // Places of the tip, the last body, within some seconds before a time.
  trail(time) {
    const until = this.momentOf(time), first = Math.max(0, Math.ceil(until - TRAIL / this.told.step));
    const points = [];
    for (let moment = first; moment < until; moment++) {
      if (!this.tips.has(moment)) this.tips.set(moment, this.bodiesAt(moment).at(-1));
      points.push(this.tips.get(moment));
    }
    points.push(this.bodiesAt(until).at(-1));
    return [0, 1, 2].map((axis) => points.map((pose) => MM * pose[axis]));
  }

  // Poses of all bodies at a moment, a fraction being between two.
  bodiesAt(moment) {
    const { parents, kinds, places, origins } = this.told, poses = [];
    const before = Math.floor(moment), after = Math.min(before + 1, this.told.count - 1), share = moment - before;
    const between = (values) => (share ? values[before] + share * (values[after] - values[before]) : values[before]);
    kinds.forEach((kind, body) => {
      if (kind === FREE) poses.push(this.freeAt(places[body], before, after, share));
      else if (parents[body] < 0) poses.push(origins[body]);
      else {
        const pose = followed(poses[parents[body]], origins[body]);
        if (kind === TURNS || kind === SLIDES) move(kind, between(this.coordinates[places[body]]), pose);
        poses.push(pose);
      }
    });
    return poses;
  }

  freeAt(place, before, after, share) {
    const columns = this.free.slice(7 * place, 7 * place + 7);
    const one = columns.map((values) => values[before]), other = columns.map((values) => values[after]);
    const isFar = one.slice(3).reduce((sum, part, i) => sum + part * other[3 + i], 0) < 0;
    const pose = one.map((part, i) => part + share * ((isFar && i > 2 ? -other[i] : other[i]) - part));
    const size = Math.hypot(...pose.slice(3));
    return pose.map((part, i) => (i > 2 ? part / size : part));
  }

  // Corners of all solids [mm] where their bodies are.
  corners(poses) {
    const { body, local: [x, y, z] } = this.told, out = [x, y, z].map((values) => new Float64Array(values.length));
    for (let i = 0; i < body.length; i++) {
      const pose = poses[body[i]], [a, b, c] = turned(pose, x[i], y[i], z[i]);
      out[0][i] = MM * pose[0] + a; out[1][i] = MM * pose[1] + b; out[2][i] = MM * pose[2] + c;
    }
    return out;
  }
}

// p + 2 v × (v × p + w p) with the quaternion w, v of a pose.
function turned(pose, a, b, c) {
  const w = pose[3], x = pose[4], y = pose[5], z = pose[6];
  const i = 2 * (y * c - z * b), j = 2 * (z * a - x * c), k = 2 * (x * b - y * a);
  return [a + w * i + y * k - z * j, b + w * j + z * i - x * k, c + w * k + x * j - y * i];
}

function product([a, b, c, d], [w, x, y, z]) {
  return [a * w - b * x - c * y - d * z, a * x + b * w + c * z - d * y, a * y - b * z + c * w + d * x, a * z + b * y - c * x + d * w];
}

// A pose that is given in the frame of another.
function followed(parent, origin) {
  const place = turned(parent, origin[0], origin[1], origin[2]);
  return [0, 1, 2].map((axis) => parent[axis] + place[axis]).concat(product(parent.slice(3), origin.slice(3)));
}

// Turn a pose about its own z, or push it along it.
function move(kind, value, pose) {
  if (kind === TURNS) pose.splice(3, 4, ...product(pose.slice(3), [Math.cos(value / 2), 0, 0, Math.sin(value / 2)]));
  else turned(pose, 0, 0, value).forEach((part, axis) => { pose[axis] += part; });
}
