// Paths: curves in a plane or in space of which the part within the visible time is drawn.

const PATH_POINTS = 6000;
const CLEAR = 20; // diagonals; a longer path is drawn more and more transparent

// Points of a path at times within a range and within the stretches in which it is shown at all;
// the pen is lifted between the stretches.
function pathWithin(curve, range) {
  const times = curve.times, parts = [];
  let count = 0;
  for (const [begin, end] of curve.during || [range]) {
    const part = [Math.max(begin, range[0]), Math.min(end, range[1])];
    if (part[0] > part[1]) continue;
    // Times are float32: the last one may be rounded beyond the end.
    const bounds = [firstNotBefore(times, Math.fround(part[0])), firstNotBefore(times, Math.fround(part[1]) + 1e-9)];
    parts.push(bounds);
    count += bounds[1] - bounds[0];
  }
  const every = Math.max(1, Math.ceil(count / PATH_POINTS)), indices = [];
  for (const [from, to] of parts) {
    for (let i = from; i < to; i += every) indices.push(i);
    if (to > from && (to - 1 - from) % every) indices.push(to - 1);
    indices.push(-1);
  }
  const pick = (values) => indices.map((i) => (i < 0 ? NaN : values[i]));
  return { times: pick(times), places: curve.places.map(pick) };
}

// Smallest and largest place along each axis, or null.
function extents(places) {
  const found = places.map((values) => {
    let low = Infinity, high = -Infinity;
    for (const value of values) { if (value < low) low = value; if (value > high) high = value; }
    return [low, high];
  });
  return found.every(([low, high]) => high >= low) ? found : null;
}

// How visible a path is, by its length in diagonals of what it fills: one that crosses itself often
// is transparent.
function opacityOf(places) {
  const found = extents(places), before = places.map(() => NaN);
  if (!found) return 1;
  let length = 0;
  for (let i = 0; i < places[0].length; i++) {
    let square = 0;
    places.forEach((values, axis) => { square += (values[i] - before[axis]) ** 2; before[axis] = values[i]; });
    if (square > 0) length += Math.sqrt(square);
  }
  const ratio = (CLEAR * Math.hypot(...found.map(([low, high]) => high - low))) / length;
  if (!(ratio < 1)) return 1;
  return places.length === 2 ? ratio ** 2 : Math.max(0.2, ratio);
}

// Ranges of equal length around a visible part that is small; null to see the whole.
function closeUp(part, whole) {
  if (!part || !whole) return null;
  const length = (ends) => Math.max(...ends.map(([low, high]) => high - low));
  if (length(part) > length(whole) / 2) return null;
  const half = 0.65 * Math.max(length(part), length(whole) / 500);
  return part.map(([low, high]) => [(low + high) / 2 - half, (low + high) / 2 + half]);
}
