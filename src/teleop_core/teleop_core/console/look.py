"""Look: the colours and the type of the page, each named once by what it means.

Colour is for meaning: grey for what is there, blue for what is to be pressed next, and three
signals. What is measured is warm, what is wanted is cool, what the person does is violet:
everywhere, in the scene and in plots.
"""

Color = tuple[int, int, int]

# -- meanings

GOOD: Color = (43, 138, 62)
"""Goes, is free."""
HELD: Color = (181, 101, 0)
"""Holds, waits, warns."""
WRONG: Color = (214, 32, 46)
"""Is stopped, touches, is at a limit; the stop itself."""
ACTION: Color = (28, 109, 208)
"""What is to be pressed next."""
MEASURED: Color = (208, 73, 12)
"""What is: paths and curves that were measured."""
WANTED: Color = (28, 109, 208)
"""What shall be: references, and the posture that the setpoints give."""
HAND: Color = (112, 72, 190)
"""What the person does: the path of the stylus, and the force on it is a :data:`WRONG` arrow."""
TARGET: Color = (230, 150, 30)
"""Points of a task."""

# -- ground

LIGHT: Color = (255, 255, 255)
DARK: Color = (20, 20, 20)
"""Ground behind the scene: viser's."""
GRID: Color = (196, 202, 208)
GRID_DARK: Color = (52, 58, 64)
"""Lines of the floor: there, and no more."""

CURVES = ("#d0490c", "#1c6dd0", "#2b8a3e", "#7048be", "#9c6b1e", "#5c6670")
"""Of plots, in the order of their series."""

_LIGHT = {
    "ground": "#ffffff", "text": "#1c2126", "muted": "#5c6670", "line": "#d9dee3",
    "good": "#2b8a3e", "held": "#9a5700", "wrong": "#c5162a", "idle": "#5c6670",
}  # fmt: skip
_DARK = {
    "ground": "#1f2328", "text": "#e6e9ec", "muted": "#9aa5b1", "line": "#343b42",
    "good": "#51cf66", "held": "#ffb84d", "wrong": "#ff7b83", "idle": "#9aa5b1",
}  # fmt: skip
"""Of texts: at least 4.5 to 1 on their ground."""

_STYLE = """\
:root { VARIABLES; --t-stop: #d6001c; --t-small: 12px; --t-text: 13px; --t-head: 16px; }
:root[data-mantine-color-scheme="dark"] { DARK_VARIABLES; }
body { font: var(--t-text)/1.45 system-ui, -apple-system, "Segoe UI", Roboto, sans-serif; }
.t-status { padding: 4px 14px; color: var(--t-color-text); font-size: var(--t-small);
  box-sizing: border-box; height: 140px; overflow-y: auto; overflow-wrap: anywhere;
  line-height: 18px;
  border-bottom: 1px solid var(--t-color-line); margin-bottom: 6px; }
.t-role { margin: 8px 14px 0; font-weight: 600; }
.t-status b { font-size: var(--t-head); font-weight: 600; line-height: 24px; }
.t-status p { margin: 0; } .t-muted { color: var(--t-color-muted); }
.t-good { color: var(--t-color-good); } .t-held { color: var(--t-color-held); }
.t-wrong { color: var(--t-color-wrong); } .t-idle { color: var(--t-color-idle); }
#t-safety { position: fixed; left: 12px; bottom: 12px; z-index: 10000; width: 230px;
  display: flex; flex-direction: column; gap: 8px; font: inherit; }
#t-safety[hidden] { display: none; }
#t-stop { height: 56px; border: 0; border-radius: 6px; background: var(--t-stop); color: #fff;
  font-family: inherit; font-size: 18px; font-weight: 700; letter-spacing: 0.02em; cursor: pointer;
  box-shadow: 0 1px 4px rgba(0,0,0,.3); touch-action: manipulation; user-select: none; }
#t-stop:hover { filter: brightness(1.08); } #t-stop:active { filter: brightness(0.85); }
#t-stop:focus-visible { outline: 3px solid var(--t-color-text); outline-offset: 2px; }
#t-starting { position: fixed; inset: 0; z-index: 9999; display: flex; align-items: center;
  justify-content: center; background: var(--t-color-ground); color: var(--t-color-text);
  font-size: var(--t-head); padding: 16px; box-sizing: border-box; text-align: center; }
#t-starting[hidden] { display: none; }
#t-banner { display: none; position: fixed; top: 0; left: 0; z-index: 10001;
  box-sizing: border-box; padding: 10px 16px; font-size: var(--t-head); line-height: 1.4;
  background: var(--t-stop); color: #fff; }
#t-banner b { font-weight: 700; margin-right: 0.6em; }
.t-says #t-banner { display: block; }
.t-stopped #t-stop { background: #fff; color: var(--t-stop); border: 3px solid var(--t-stop); }
.t-stopped canvas { filter: grayscale(0.85) opacity(0.7); }
@media (max-width: 575px) {
  #t-safety { left: 0; right: 0; top: 0; bottom: auto; width: auto; }
  #t-stop { border-radius: 0; width: 100%; }
  #t-banner { top: 56px; font-size: var(--t-text); }
}
"""


def style() -> str:
    """Style sheet that is added to the page."""
    light, dark = ("; ".join(f"--t-color-{name}: {value}" for name, value in kind.items())
                   for kind in (_LIGHT, _DARK))  # fmt: skip
    return _STYLE.replace("DARK_VARIABLES", dark).replace("VARIABLES", light)
