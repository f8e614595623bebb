"""Inputs: elements that show and change a parameter on the page; each of seven kinds of values has its own element."""

import ast
import math
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import Any, cast

import viser

from teleop_console.link import ParameterInfo, Setting
from teleop_core.base.parameters import specs
from teleop_core.graph.layers import declared_groups

KINDS = ("switch", "choice", "whole number", "slider", "number", "vector", "text")
"""Kinds of inputs: for yes or no, names, integers, numbers with two bounds, other numbers, short lists of numbers,
texts."""
FIELDS = 7
"""Largest length of a vector with a field for each number; a longer vector is shown as a text."""
LATER = "↻"
"""Mark of a parameter that takes effect only in a new session."""
_WIDE = 200.0  # largest range of a slider, as a multiple of its value; a larger range is too coarse for a hand
_DIGITS = 6  # digits after the decimal point of a slider's numbers


def kind_of(info: ParameterInfo) -> str:
    """Kind of element, one of :data:`KINDS`, that shows a parameter."""
    value = info.value
    if isinstance(value, bool):
        return "switch"
    if isinstance(value, tuple):
        is_plain = all(isinstance(one, int | float) and not isinstance(one, bool) for one in value)
        return "vector" if is_plain and 1 < len(value) <= FIELDS else "text"
    if isinstance(value, int):
        return "whole number"
    if isinstance(value, float):
        return "slider" if _is_slider(info) else "number"
    return "choice" if info.choices else "text"


def _is_slider(info: ParameterInfo) -> bool:
    """Whether a parameter lies within bounds whose range suits a slider."""
    low, high, value = info.lower, info.upper, info.value
    if low is None or high is None or not low <= float(value) <= high:  # type: ignore[arg-type]
        return False
    default = default_of(info.node, info.name)
    usual = max(abs(float(one)) for one in (value, default) if isinstance(one, int | float))
    return low < high and (high - low <= _WIDE * usual or not usual)


class Input:
    """Input of one parameter in the present container of the page.

    Args:
        gui: The page.
        label: Text before the input; the unit and the mark of a fixed parameter follow it.
        info: The parameter.
        names: Names of a vector's numbers; if their count does not match, x, y, z or 1, 2, ... are used.

    Attributes:
        kind: Kind of value, one of :data:`KINDS`.
        parts: Elements of the input; a vector has one element for each number.
    """

    def __init__(self, gui: viser.GuiApi, label: str, info: ParameterInfo, names: Sequence[str] = ()) -> None:
        self._info, self.kind = info, kind_of(info)
        label = f"{label}{unit(info.doc)}{f' {LATER}' if info.is_fixed else ''}"
        self._own: Any = None
        if self.kind != "vector":
            self._own = _element(gui, self.kind, label, info)
            self.parts = [self._own]
            return
        assert isinstance(info.value, tuple)
        count = len(info.value)
        known = names if len(names) == count else "xyz" if count == 3 else [str(i + 1) for i in range(count)]
        self._own = gui.add_folder(label)
        with self._own:
            self.parts = [_number(gui, name, one, info) for name, one in zip(known, info.value, strict=True)]

    @property
    def value(self) -> Setting | None:
        """Present value, with the parameter's type; None if the input has no valid value."""
        if self.kind != "vector":
            return parsed(self._own.value, self._info)
        assert isinstance(self._info.value, tuple)
        like = type(self._info.value[0])
        return cast("Setting", tuple(like(part.value) for part in self.parts))

    @property
    def said(self) -> object:
        """Shown value, in the form in which the element shows it."""
        return self._own.value if self.kind != "vector" else shown(self.value or ())

    def show(self, value: Setting) -> bool:
        """Show a value; returns false if this input cannot show values of this kind."""
        values = value if self.kind == "vector" and isinstance(value, tuple) else (shown(value),)
        if len(values) != len(self.parts) or any(not _takes(p, v) for p, v in zip(self.parts, values, strict=True)):
            return False
        for part, one in zip(self.parts, values, strict=True):
            if part.value != one:
                part.value = one
        return True

    def on_change(self, act: Callable[[int | None], None]) -> None:
        """Call a function whenever a person changes the input; its argument is the number of the browser."""
        for part in self.parts:
            part.on_update(lambda event: act(event.client_id))

    def remove(self) -> None:
        """Remove the input from the page."""
        self._own.remove()


def _takes(part: Any, value: object) -> bool:
    """Whether an element can show a value."""
    low, high = getattr(part, "min", None), getattr(part, "max", None)
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    if low is not None and high is not None and is_number:
        return bool(low <= value <= high)  # type: ignore[operator]
    return not hasattr(part, "options") or value in part.options


def _element(gui: viser.GuiApi, kind: str, label: str, info: ParameterInfo) -> Any:
    value, hint = shown(info.value), hint_of(info)
    if kind == "switch":
        return gui.add_checkbox(label, bool(value), hint=hint)
    if kind == "choice":
        options = info.choices if value in info.choices else (str(value), *info.choices)
        return gui.add_dropdown(label, options, initial_value=str(value), hint=hint)
    if kind == "slider":
        assert info.lower is not None
        assert info.upper is not None
        step = _fine_step(float(value), info.lower, info.upper)
        low, high = float(info.lower), float(info.upper)
        return gui.add_slider(label, min=low, max=high, step=step, initial_value=float(value), hint=hint)
    if kind == "text":
        return gui.add_text(label, str(value), hint=hint)
    return _number(gui, label, value, info)


def _number(gui: viser.GuiApi, label: str, value: Any, info: ParameterInfo) -> Any:
    step = 1 if isinstance(value, int) else _step(value)
    low, high = info.lower, info.upper
    if not (-math.inf if low is None else low) <= value <= (math.inf if high is None else high):
        low = high = None  # the value `off` lies outside of the bounds but is allowed
    return gui.add_number(label, value, min=low, max=high, step=step, hint=hint_of(info))


def hint_of(info: ParameterInfo) -> str:
    """Text with the meaning, the bounds and the default of a parameter, and the time at which a change takes effect."""
    bounds = ""
    if info.lower is not None or info.upper is not None:
        low = "−∞" if info.lower is None else f"{info.lower:g}"
        bounds = f" ({low} to {'∞' if info.upper is None else f'{info.upper:g}'})"
    default = default_of(info.node, info.name)
    bounds += "" if default is None else f"; default {shown(default)}"
    return f"{info.doc}{bounds}" + (f" {LATER} takes effect in a new session" if info.is_fixed else "")


@cache
def _defaults() -> Mapping[tuple[str, str], Any]:
    return {(stage, spec.name): spec.default for stage, group in declared_groups().items() for spec in specs(group)}


def default_of(node: str, name: str) -> Setting | None:
    """Default of a parameter of a known stage; None for other parameters and for parameters without a default."""
    return _defaults().get((node.rpartition("/")[2], name))


def shown(value: Setting) -> bool | int | float | str:
    """Value as a single element shows it; a list is converted to a text."""
    if not isinstance(value, tuple):
        return value
    words = [f"{one:g}" if isinstance(one, float) else str(one) for one in _words(value)]
    return f"[{', '.join(words)}]"


def text(value: Setting) -> str:
    """Text of a value for ``--set``."""
    if not isinstance(value, tuple):
        return str(value)
    return f"[{','.join(map(str, _words(value)))}]"


def _words(values: tuple[float | str, ...]) -> list[float | str]:
    """Return numbers unchanged. If one text could not be read from a list without quotes, all texts get quotes."""
    is_quoted = any(isinstance(one, str) and set(one) & set(",[]()'\"") for one in values)
    return [repr(one) if is_quoted and isinstance(one, str) else one for one in values]


def form(info: ParameterInfo) -> str:
    """Text that names the type of a parameter's value."""
    if isinstance(info.value, tuple):
        return "list such as [0.1, 0.2]"
    return {bool: "yes or no", int: "whole number", float: "number"}.get(type(info.value), "text")


def parsed(said: object, info: ParameterInfo) -> Setting | None:
    """Value of an element, converted to the parameter's type; None if it is not valid."""
    if isinstance(info.value, bool):
        return bool(said)
    if isinstance(info.value, tuple):
        return _list(str(said), info.value)
    if isinstance(info.value, int | float):
        assert isinstance(said, int | float)
        return int(said) if isinstance(info.value, int) else float(said)
    return str(said)


def _list(said: str, like: tuple[object, ...]) -> Setting | None:
    """Tuple from a text such as ``[1, 2]`` or ``[a, b]``; the items are numbers if the present value has numbers."""
    try:
        found = ast.literal_eval(said)
    except (ValueError, SyntaxError):
        words = said.strip().strip("[]()").split(",")
        found = tuple(word.strip() for word in words if word.strip())
    if not isinstance(found, list | tuple):
        found = (found,)
    if like and isinstance(like[0], float):
        numbers = [float(one) for one in found if isinstance(one, int | float)]
        return tuple(numbers) if len(numbers) == len(found) else None
    return tuple(found)


def unit(doc: str) -> str:
    """Unit in brackets at the end of a meaning, with a space before it; empty if the meaning has no unit."""
    _, bracket, found = doc.rpartition(" [")
    return f"{bracket}{found}" if found.endswith("]") else ""


def _step(value: float) -> float:
    """A twentieth of a value, rounded."""
    if value == 0.0:
        return 0.001
    return float(f"{abs(value) / 20.0:.0e}")


def _fine_step(value: float, low: float, high: float) -> float:
    """Step of a slider: a power of ten of which the value is a multiple, at most a hundredth of the slider's range."""
    digits = next((d for d in range(_DIGITS) if round(value, d) == value), _DIGITS)
    return min(10.0 ** math.floor(math.log10((high - low) / 100.0)), 10.0**-digits)
