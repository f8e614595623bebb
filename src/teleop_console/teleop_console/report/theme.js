// Theme: the colours of plots by day and by night, from the page's style sheet.

const NIGHT = window.matchMedia("(prefers-color-scheme: dark)");
const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const THROUGH = "rgba(0,0,0,0)"; // the card below a plot has the ground

function themed(layout) { // a plotly layout in the colours of the page; what it says itself stays
  const axis = { gridcolor: css("--grid"), zerolinecolor: css("--line"), linecolor: css("--soft") };
  const all = { ...layout, paper_bgcolor: THROUGH, plot_bgcolor: THROUGH, font: { ...layout.font, color: css("--text"),
    family: "system-ui, Segoe UI, Roboto, Arial, sans-serif" },
    modebar: { bgcolor: THROUGH, color: css("--soft"), activecolor: css("--text") } };
  for (const key of Object.keys(all)) if (/^[xy]axis/.test(key)) all[key] = { ...all[key], ...axis };
  for (const key of Object.keys(all).filter((name) => /^scene/.test(name))) {
    all[key] = { ...all[key] };
    for (const one of ["xaxis", "yaxis", "zaxis"])
      all[key][one] = { ...all[key][one], gridcolor: css("--grid"), backgroundcolor: THROUGH, zeroline: false };
  }
  return all;
}

function luminance(color) { // of #rrggbb, as WCAG has it
  const [r, g, b] = [1, 3, 5].map((at) => Math.pow(parseInt(color.slice(at, at + 2), 16) / 255, 2.2));
  return 0.2126 * r + 0.7152 * g + 0.0722 * b;
}

function seen(trace) { // by night a nearly black line or mark is light
  if (!NIGHT.matches) return trace;
  const light = (color) => (/^#[0-9a-f]{6}$/i.test(color) && luminance(color) < 0.09 ? css("--text") : color);
  const found = { ...trace };
  for (const part of ["line", "marker", "error_y"])
    if (typeof found[part]?.color === "string") found[part] = { ...found[part], color: light(found[part].color) };
  return found;
}

NIGHT.addEventListener("change", () => location.reload());
