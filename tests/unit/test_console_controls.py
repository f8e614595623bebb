"""Controls of the console: what a part must be, and what the built-in ones ask of a session."""

from typing import Any

import pytest

from teleop_console.controls import CONTROLS, Control, commands, register_control
from teleop_core.slave.operation.states import AT_REST_ONLY, STILL_PRESSED


class Asked:
    """A session that takes what it is told, after it was asked some times whether it rests."""

    def __init__(self, moving: int = 0, why: str = "") -> None:
        self.words: list[tuple[str, str]] = []
        self.pressed: list[bool] = []
        self.buttons: list[tuple[str, str]] = []
        self._moving, self._why = moving, why

    def command(self, word: str, arm: str = "") -> tuple[bool, str]:
        self.words.append((word, arm))
        self._moving -= 1
        return self._moving < 0, f"{word}: {'done' if self._moving < 0 else self._why}"

    def press(self, *, is_pressed: bool) -> None:
        self.pressed.append(is_pressed)

    def press_button(self, arm: str, name: str) -> None:
        self.buttons.append((arm, name))


def test_initialize_lets_the_stop_go_and_then_resets_enables_and_homes() -> None:
    session: Any = Asked()
    answers = CONTROLS.find("Initialize").act(session, "left")
    assert session.pressed == [False]
    assert session.words == [("reset", "left"), ("enable", "left"), ("home", "left")]
    assert [is_taken for is_taken, _ in answers] == [True] * 3


@pytest.mark.parametrize("why", [AT_REST_ONLY, STILL_PRESSED])
def test_an_arm_that_comes_to_rest_or_hears_of_a_release_soon_is_asked_again(why: str) -> None:
    session: Any = Asked(moving=2, why=why)
    assert commands("enable")(session, "") == [(True, "enable: done")]
    assert len(session.words) == 3


def test_buttons_of_the_stylus_are_those_of_the_device() -> None:
    session: Any = Asked()
    for name in ("mode", "fixture"):
        CONTROLS.find(name).act(session, "")
    assert session.buttons == [("", "mode"), ("", "fixture")]


def test_a_control_of_ones_own_stands_behind_those_that_are_there() -> None:
    mine = register_control(Control("Mine", "does nothing", lambda link, arm: ()))
    try:
        assert CONTROLS.names()[-1] == mine.name
    finally:
        CONTROLS.remove("Mine")
