// Bands: stretches in which the slave was held back, behind every plot against time.

// Stretches within a range, joined where they are nearer than a pixel, and no narrower than that.
function joined(stretches, [begin, end], width) {
  const found = [];
  for (const [from, to] of stretches) {
    if (to < begin || from > end) continue;
    const last = found[found.length - 1];
    if (last && from - last[1] <= width) last[1] = Math.max(last[1], to, from + width);
    else found.push([Math.max(from, begin - (end - begin)), Math.max(to, from + width)]);
  }
  return found;
}

// One shape per cause, whatever the number of stretches; plotly.js lists it in the legend.
function bandShapes(bands, axis, range, width, isListed) {
  const [low, high] = axis.height;
  return bands.map((band) => {
    const stretches = joined(band.stretches, range, width);
    const path = stretches.map(([from, to]) => `M${from},${low}L${to},${low}L${to},${high}L${from},${high}Z`).join("");
    return {
      type: "path", layer: "below", xref: axis.x, yref: axis.y, path: path || "M0,0Z",
      fillcolor: band.color, opacity: 0.22, line: { width: 0 },
      name: band.cause, showlegend: isListed, legendgroup: band.cause,
    };
  });
}
