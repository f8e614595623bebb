// Thin: what is drawn of a curve, all samples or the extremes of as many stretches as there are pixels.

function firstNotBefore(times, time) {
  let low = 0, high = times.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (times[middle] < time) low = middle + 1; else high = middle;
  }
  return low;
}

// Samples [from, to) of a range, with one more on each side, so that lines reach its ends.
function within(times, [begin, end]) {
  const from = Math.max(0, firstNotBefore(times, begin) - 1);
  return [from, Math.min(times.length, firstNotBefore(times, end) + 1)];
}

// Curve through the samples [from, to), or through the smallest and the largest one of each of
// `count` stretches, where they are.
function thinned(times, values, from, to, count) {
  if (to - from <= 2 * count) return { x: times.slice(from, to), y: values.slice(from, to) };
  const x = new Float64Array(2 * count), y = new Float64Array(2 * count);
  for (let stretch = 0; stretch < count; stretch++) {
    const begin = from + Math.floor((stretch * (to - from)) / count);
    const end = from + Math.floor(((stretch + 1) * (to - from)) / count);
    let low = begin, high = begin;
    for (let i = begin + 1; i < end; i++) {
      if (values[i] < values[low] || Number.isNaN(values[low])) low = i;
      if (values[i] > values[high] || Number.isNaN(values[high])) high = i;
    }
    const [one, other] = low < high ? [low, high] : [high, low];
    x[2 * stretch] = times[one]; y[2 * stretch] = values[one];
    x[2 * stretch + 1] = times[other]; y[2 * stretch + 1] = values[other];
  }
  return { x, y };
}
