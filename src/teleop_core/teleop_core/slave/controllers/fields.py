"""Fields: parameters that several control laws share, declared once."""

from typing import Any

from teleop_core.base.parameters import Within, parameter


def bandwidth(poles: str, source: str = "assumed: the drive table's, as of pid") -> Any:
    """Closed-loop pole of each joint [rad/s]; ``poles``: "double" or "triple"."""
    return parameter((), Within(0.1, 500.0, "rad/s"), f"{poles} closed-loop pole of each joint", source=source)


def ratio(what: str) -> Any:
    """Pole of the observer or of the motion filters, divided by that of the loop."""
    return parameter(
        3.5,
        Within(1.0, 10.0),
        f"pole of the {what}, divided by the pole of the loop, if encoder noise allows it",
        source="assumed: the middle, √12, of the rule of two to six",
    )


def friction_share(use: str) -> Any:
    """Share of known dry friction that a law uses; ``use`` ends the parameter's text with the purpose."""
    return parameter(
        0.8,
        Within(0.0, 1.5),
        f"share of known dry friction {use}",
        source="assumed: less than all of it, because too much compensation pushes the joint ahead",
    )


def friction_counts() -> Any:
    """Travel over which the compensation of dry friction builds up [encoder counts]."""
    return parameter(
        4.0,
        Within(0.1, 1000.0),
        "travel, in encoder counts, after which dry friction acts fully",
        source="assumed: a joint moves elastically by a few encoder counts before it slips",
    )


def dead_band(use: str) -> Any:
    """Error [encoder counts] within which a joint counts as at rest; ``use`` ends the text with the effect of this."""
    return parameter(
        0.5,
        Within(0.0, 100.0),
        f"error, in encoder counts, {use}",
        source="derived: the error at the nearest encoder count is never larger, so that the joint can rest there",
    )
