"""Former shapes: fixtures and objects in recordings of version 0.6 and before.

In these versions shapes had a diameter instead of a radius, and each shape that the tool must stay out of was a
separate kind. Only recordings are converted in this way; for a user's file an error lists the known names.
"""

import re
from collections.abc import Mapping
from typing import Any

_KEPT_OUT, _FIXTURE, _KIND = "keep_out_", "fixture.", "fixture.kind"
_OF_WORLD = {
    "world.box.edges": "world.box.size",
    "world.cylinder.height": "world.cylinder.length",
    "world.button.height": "world.button.length",
}
_OF_FIXTURE = ("place", "keep_out")  # parameters of the fixture, not of its shape
_DIAMETER = re.compile(r"\bdiameter\s*=\s*([^\s,]+)")


def present_fixture(kind: str, values: Mapping[str, Any]) -> tuple[str, dict[str, Any]]:
    """Present name of a fixture's shape, and its present values, including ``place`` and ``keep_out``.

    Args:
        kind: Former kind of the fixture, such as ``keep_out_sphere``.
        values: Values of the fixture's own parameters, by name.
    """
    shape, found = kind.removeprefix(_KEPT_OUT), dict(values)
    if shape in {"sphere", "cylinder"} and "diameter" in found:
        found["radius"] = 0.5 * found.pop("diameter")
    if shape in {"line", "path"} and "tolerance" in found:
        found["radius"] = found.pop("tolerance")
    if shape in {"union", "intersection"} and "parts" in found:
        found["parts"] = [_part(text) for text in found["parts"]]
    return shape, found | ({} if shape == kind else {"keep_out": True})


def _part(text: str) -> str:
    text = _DIAMETER.sub(lambda found: f"radius={0.5 * float(found[1])!r}", text)
    text = text.replace("tolerance", "radius")
    if text.startswith(_KEPT_OUT):
        text = "not " + text.removeprefix(_KEPT_OUT).replace("place", "at", 1)
    return text


def present_layer(layer: Mapping[str, Mapping[str, Any]]) -> dict[str, dict[str, Any]]:
    """Values of a recording's stages, by their present dotted names."""
    return {stage: _present_stage(values) for stage, values in layer.items()}


def _present_stage(values: Mapping[str, Any]) -> dict[str, Any]:
    kind, found = str(values.get(_KIND, "")), dict[str, Any]()
    # Values of the used fixture come last, because ``sphere`` and ``keep_out_sphere`` get the same present name.
    for name in sorted(values, key=lambda name: name.startswith(f"{_FIXTURE}{kind}.")):
        head, dot, own = name.removeprefix(_FIXTURE).partition(".")
        if not (name.startswith(_FIXTURE) and dot):
            found[_OF_WORLD.get(name, name)] = values[name]
            continue
        shape, told = present_fixture(head, {own: values[name]})
        for own, value in told.items() if head in {shape, kind} else ():
            if own not in _OF_FIXTURE:
                found[f"{_FIXTURE}{shape}.{own}"] = value
            elif head == kind:
                found[_FIXTURE + own] = value
    return found | ({_KIND: kind.removeprefix(_KEPT_OUT)} if kind else {})
