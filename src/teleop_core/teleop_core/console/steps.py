"""Small steps: the stylus moved by keys and buttons, a millimetre or a degree at a time."""

from collections.abc import Callable
from typing import Literal

import viser

from teleop_core.console.stylus import AXES, Stylus

Key = Literal["arrowup", "arrowdown", "arrowleft", "arrowright", "pageup", "pagedown"]
_KEYS: dict[Key, tuple[str, int]] = {
    "arrowright": ("x", 1), "arrowleft": ("x", -1), "arrowup": ("y", 1), "arrowdown": ("y", -1),
    "pageup": ("z", 1), "pagedown": ("z", -1),
}  # fmt: skip
"""Keys and the step that each is, in the master's base."""


class Steps:
    """Buttons in the present container of the page, and keys; with shift, keys turn.

    Args:
        server: The page.
        stylus: What moves.
        arms: Namespaces of the arms; keys move the chosen one.
        may_drive: Whether a browser may command the arms.
    """

    def __init__(
        self, server: viser.ViserServer, stylus: Stylus, arms: tuple[str, ...],
        may_drive: Callable[[int], bool],
    ) -> None:  # fmt: skip
        self._stylus, self._may_drive, self._arm = stylus, may_drive, arms[0]
        if len(arms) > 1:
            choice = server.gui.add_dropdown("arm", [arm or "first" for arm in arms])
            choice.on_update(lambda _: self._choose(arms[choice.options.index(choice.value)]))
        for axis in AXES:
            step = "1°" if axis.startswith("r") else "1 mm"
            buttons = server.gui.add_button_group(axis, ("−", "+"), hint=f"{step} in master_base")
            buttons.on_click(
                lambda event, axis=axis: self._step(  # type: ignore[misc]
                    event.client_id, axis, 1 if event.target.value == "+" else -1
                )
            )
        for key, (axis, sign) in _KEYS.items():
            self._add_key(server, key, axis, sign)

    def _add_key(self, server: viser.ViserServer, key: Key, axis: str, sign: int) -> None:
        for modifier, moved, word in (
            (None, axis, "1 mm along"),
            ("shift", f"r{axis}", "1° about"),
        ):
            command = server.gui.add_command(
                f"Stylus {word} {'+' if sign > 0 else '−'}{axis}", hotkey=key,
                modifier="shift" if modifier else None,
            )  # fmt: skip
            command.on_trigger(
                lambda event, moved=moved: self._step(event.client_id, moved, sign)  # type: ignore[misc]
            )

    def _choose(self, arm: str) -> None:
        self._arm = arm

    def _step(self, client: int | None, axis: str, sign: int) -> None:
        if client is not None and self._may_drive(client):
            self._stylus.nudge(self._arm, axis, sign)
