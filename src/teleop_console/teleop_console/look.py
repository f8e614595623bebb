"""Look: the colours and fonts of the page; each colour is defined once, with one meaning.

Each colour has a meaning; everything without a meaning is grey. Red is only for errors and the stop. Measured values
are orange, wanted values and the next button are blue, actions of the person are violet, and forces are magenta. This
is true for the scene and for texts. The colours of curves in a plot have no meaning; they only distinguish the curves.
"""

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

from teleop_core.robots.bodies import Role

Color = tuple[int, int, int]


class Meaning(NamedTuple):
    """Colours of one meaning: in the scene, for texts on a light page, and for texts on a dark page."""

    scene: Color
    light: str
    dark: str


MEANINGS: Mapping[str, Meaning] = MappingProxyType(
    {
        "good": Meaning((43, 138, 62), "#127f48", "#7ee8a8"),  # active or free
        "held": Meaning((157, 105, 0), "#9d6900", "#ffc14d"),  # holding, waiting, a warning, or at a limit
        "wrong": Meaning((200, 0, 26), "#a80016", "#ff6060"),  # stopped or in contact; also the stop button
        "idle": Meaning((92, 102, 112), "#5c6670", "#9aa5b1"),  # present but not active
        "measured": Meaning((217, 95, 2), "#b34d00", "#ff9f4d"),  # measured paths
        "wanted": Meaning((28, 109, 208), "#1c6dd0", "#74a9f2"),  # wanted values; also the button to press next
        "hand": Meaning((112, 72, 190), "#7048be", "#b197fc"),  # path of the stylus
        "force": Meaning((190, 24, 132), "#a61e74", "#f06ec0"),  # forces on stylus and tip
        "target": Meaning((12, 133, 153), "#0b7285", "#3bc9db"),  # points and objects of a task
    }
)
"""All colours with a meaning; the contrast between text and background is at least 4.5 to 1."""
GOOD, HELD, WRONG, MEASURED, WANTED, HAND, FORCE, TARGET = (
    MEANINGS[name].scene for name in ("good", "held", "wrong", "measured", "wanted", "hand", "force", "target")
)

ROLES: Mapping[Role, Color] = MappingProxyType(
    {
        "base": (96, 108, 122),
        "link": (196, 204, 212),
        "joint": (104, 126, 150),
        "leg": (150, 162, 176),
        "platform": (120, 140, 160),
        "tool": (72, 82, 94),
    }
)
"""Greys of solids, visible on a light and on a dark background."""
LIGHT: Color = (255, 255, 255)
DARK: Color = (20, 20, 20)
"""Background of the scene on a dark page: viser's colour, which is also in the style sheet."""
GRID: Color = (196, 202, 208)
GRID_DARK: Color = (52, 58, 64)
"""Colour of the floor's lines on a dark page."""
CURVES = ("#0072b2", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#8c6d46")
"""Colours of curves, in their order; people with red-green colour blindness can distinguish them (Okabe and Ito 2008).
"""

_LIGHT = {
    "scene": "#ffffff",
    "ground": "#ffffff",
    "text": "#1c2126",
    "muted": "#5c6670",
    "line": "#d9dee3",
    "field": "#7d8790",
}
_DARK = {
    "scene": "#141414",
    "ground": "#1f2328",
    "text": "#e6e9ec",
    "muted": "#9aa5b1",
    "line": "#343b42",
    "field": "#7f8a95",
}

_STYLE = """\
:root { VARIABLES; --t-stop: STOP; --t-next: NEXT;
  --t-small: 12px; --t-text: 13px; --t-head: 16px; }
:root[data-mantine-color-scheme="dark"] { DARK_VARIABLES; }
@media (prefers-color-scheme: dark) { :root.t-choosing { DARK_VARIABLES; color-scheme: dark; } }
body { font: var(--t-text)/1.45 system-ui, -apple-system, "Segoe UI", Roboto, sans-serif; }
.t-status { padding: 4px 14px; color: var(--t-color-text); font-size: var(--t-small);
  box-sizing: border-box; height: 184px; overflow-y: auto; overflow-wrap: anywhere;
  line-height: 18px;
  border-bottom: 1px solid var(--t-color-line); margin-bottom: 6px; }
.t-role { margin: 8px 14px 0; font-weight: 600; }
.t-status b { font-size: var(--t-head); font-weight: 600; line-height: 24px; }
.t-status p { margin: 0; } .t-muted { color: var(--t-color-muted); }
.t-good { color: var(--t-color-good); } .t-held { color: var(--t-color-held); }
.t-next { color: var(--t-color-wanted); }
.t-wrong { color: var(--t-color-wrong); } .t-idle { color: var(--t-color-idle); }
#t-safety { position: fixed; left: 12px; bottom: 12px; z-index: 10000; width: 230px;
  display: flex; flex-direction: column; gap: 8px; font: inherit; }
#t-stop[hidden], #t-end[hidden], #t-press[hidden] { display: none; }
#t-stop { height: 56px; border: 2px solid #fff; border-radius: 6px; background: var(--t-stop); color: #fff;
  font-family: inherit; font-size: 18px; font-weight: 700; letter-spacing: 0.02em; cursor: pointer;
  box-shadow: 0 1px 4px rgba(0,0,0,.3); touch-action: manipulation; user-select: none; }
#t-stop:hover { filter: brightness(1.08); } #t-stop:active { filter: brightness(0.85); }
#t-stop:focus-visible { outline: 3px solid var(--t-color-text); outline-offset: 2px; }
#t-starting { position: fixed; inset: 0; z-index: 9999; display: flex; flex-direction: column; align-items: center;
  justify-content: center; gap: 8px; background: var(--t-color-ground); color: var(--t-color-text);
  font-size: var(--t-head); padding: 16px; box-sizing: border-box; text-align: center; }
#t-starting::before { content: "One moment, please"; font-size: 22px; font-weight: 650; }
#t-starting[hidden] { display: none; }
#t-banner { display: none; position: fixed; top: 0; left: 0; z-index: 10001;
  box-sizing: border-box; padding: 10px 16px; font-size: var(--t-head); line-height: 1.4;
  background: var(--t-stop); color: #fff; }
#t-banner b { font-weight: 700; margin-right: 0.6em; }
.t-says #t-banner { display: block; }
.mantine-Notification-description { color: var(--t-color-text) !important; }
::placeholder { color: var(--t-color-muted) !important; opacity: 1; }
#root { --mantine-color-dimmed: var(--t-color-muted); --mantine-primary-color-filled: var(--t-color-wanted);
  --mantine-color-blue-filled: var(--t-color-wanted); }
#root button[style*="color-blue-filled"] { background: var(--t-next); color: #fff; }
#root .mantine-Slider-markLabel { color: var(--t-color-muted); }
#root input:not([data-disabled]) { border-color: var(--t-color-field); }
#root input:focus-visible { outline: 3px solid var(--t-color-wanted); outline-offset: 1px; }
#root button[style*="color-gray-filled"] { background: var(--t-color-ground); color: var(--t-color-text);
  border: 1px solid var(--t-color-field); }
#root button[style*="color-gray-filled"]:disabled { color: var(--t-color-muted); border-color: var(--t-color-line); }
.t-spoken { position: absolute; width: 1px; height: 1px; margin: 0; overflow: hidden; clip-path: inset(50%); }
.t-stopped #t-stop { background: #fff; color: var(--t-stop); border: 3px solid var(--t-stop); }
.t-stopped canvas { filter: grayscale(0.85) opacity(0.7); }
@media (prefers-reduced-motion: reduce) { *, *::before, *::after {
  animation-duration: 1ms !important; transition-duration: 1ms !important; scroll-behavior: auto !important; } }
@media (max-width: 575px) {
  #t-safety { left: 0; right: 0; top: 0; bottom: auto; width: auto; pointer-events: none; }
  #t-safety > * { order: 1; pointer-events: auto; } #t-press { margin: 0 8px; }
  #t-stop { border-radius: 0; width: 100%; order: 0; }
  #t-banner { top: 56px; font-size: var(--t-text); }
  #root .mantine-Paper-root[style*="position: fixed"] { max-height: 46% !important; }
  #root .mantine-Paper-root[style*="position: fixed"], #root [style*="width: 20em"] {
    width: 100% !important; }
  .t-status { height: auto; max-height: 166px; }
}
"""


_PARTS = tuple(Path(__file__).with_name(name) for name in ("start.css", "strip.css"))


def style(form: Path | None = None) -> str:
    """Style sheet that is added to the page.

    It contains the styles of the form, the timeline, and an optional other form.
    """
    curves = {f"curve{i}": color for i, color in enumerate(CURVES)}
    light = _LIGHT | curves | {name: one.light for name, one in MEANINGS.items()}
    dark = _DARK | {name: one.dark for name, one in MEANINGS.items()}
    stop = f"#{bytes(WRONG).hex()}"  # readable on any background, below white letters
    files = (*_PARTS, *((form,) if form is not None else ()))
    return (
        "".join((_STYLE, *(file.read_text(encoding="utf-8") for file in files)))
        .replace("STOP", stop)
        .replace("NEXT", MEANINGS["wanted"].light)
        .replace("DARK_VARIABLES", _variables(dark))
        .replace("VARIABLES", _variables(light))
    )


def _variables(colors: Mapping[str, str]) -> str:
    return "; ".join(f"--t-color-{name}: {value}" for name, value in colors.items())
