"""Colours of the page: one of each meaning, and of each meaning one."""

import colorsys
import re
from collections.abc import Iterator
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

import teleop_console
from teleop_console.link import View
from teleop_console.look import CURVES, MEANINGS, ROLES, Color
from teleop_console.status import status_html
from teleop_core.hand.input_device import UNHELD
from teleop_core.kernels.geometry import Array

COLOR = re.compile(r"#[0-9a-fA-F]{6}\b|rgba?\(|\(\d{2,3}, \d{1,3}, \d{2,3}\)")
GROUNDS = {"light": "#ffffff", "dark": "#1f2328"}
STATES = ("good", "held", "wrong", "idle")
APART = 15.0
"""Distance in CIELAB of two states; 2.3 can just be seen (Mahy et al. 1994)."""
TO_XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
EYES = {
    "all cones": np.eye(3),
    "no long cones": np.array(
        [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]]
    ),
    "no middle cones": np.array(
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]]
    ),
}
"""What of a colour's light an eye sees (Machado, Oliveira and Fernandes 2009, severity 1)."""


def rgb(text: str) -> Color:
    red, green, blue = bytes.fromhex(text.removeprefix("#"))
    return red, green, blue


def is_red(color: Color) -> bool:
    """Whether a colour is a red to the eye: its hue within 20 degrees of it, and no grey."""
    hue, _, saturation = colorsys.rgb_to_hls(*(part / 255 for part in color))
    return min(hue, 1.0 - hue) * 360.0 < 20.0 and saturation > 0.2


def all_colors() -> Iterator[tuple[str, Color]]:
    for name, one in MEANINGS.items():
        yield from ((name, color) for color in (one.scene, rgb(one.light), rgb(one.dark)))
    yield from ROLES.items()
    yield from ((f"curve {i}", rgb(text)) for i, text in enumerate(CURVES))


def test_what_is_wrong_is_red_and_nothing_else_is() -> None:
    assert {name for name, color in all_colors() if is_red(color)} == {"wrong"}
    assert all(is_red(color) for name, color in all_colors() if name == "wrong")


def test_no_two_things_have_one_color() -> None:
    """Greys are one thing: what is there."""
    names = {"idle": "there"} | dict.fromkeys(ROLES, "there")
    named = [(names.get(name, name), color) for name, color in all_colors()]
    for (one, color), (other, same) in combinations(named, 2):
        distance = max(abs(a - b) for a, b in zip(color, same, strict=True))
        assert one == other or distance > 10, (one, other)


def linear(text: str) -> Array:
    """Light (3,) of a colour of sRGB, 0 to 1."""
    parts = np.array(rgb(text)) / 255
    return np.where(parts <= 0.04045, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4)


def lab(light: Array) -> Array:
    """Place (3,) in CIELAB of some light, under D65."""
    ratio = TO_XYZ @ light / TO_XYZ.sum(axis=1)
    root = np.where(ratio > (6 / 29) ** 3, np.cbrt(ratio), ratio / (3 * (6 / 29) ** 2) + 4 / 29)
    return np.array([116 * root[1] - 16, 500 * (root[0] - root[1]), 200 * (root[1] - root[2])])


@pytest.mark.parametrize("eye", EYES)
@pytest.mark.parametrize("ground", GROUNDS)
def test_states_are_told_apart_by_all_eyes(eye: str, ground: str) -> None:
    """By colour alone; each has a word too. In the scene, that a fixture is touched from that it is not."""
    free, touched = (
        lab(np.clip(EYES[eye] @ linear(f"#{bytes(MEANINGS[n].scene).hex()}"), 0, 1)) for n in ("good", "wrong")
    )
    assert np.linalg.norm(free - touched) > APART
    seen = {name: lab(np.clip(EYES[eye] @ linear(getattr(MEANINGS[name], ground)), 0, 1)) for name in STATES}
    for one, other in combinations(STATES, 2):
        assert np.linalg.norm(seen[one] - seen[other]) > APART, (one, other)


def test_colors_of_the_page_stand_in_one_table() -> None:
    for file in Path(teleop_console.__path__[0]).glob("*.*"):
        if file.suffix in {".py", ".js"} and file.name != "look.py":
            assert not COLOR.findall(file.read_text()), file.name


def test_a_hand_that_rests_is_information_and_no_warning() -> None:
    news = (f"operator: waits for operator/servo_cp: {UNHELD}", "ik: 3 late ticks")
    page = status_html(View(news=news, is_fresh=True), "coarse_box", "")
    rests, late = re.findall(r'<span class="t-(\w+)">(.) (?:operator|ik)', page)
    assert (rests, late) == (("muted", "ℹ"), ("held", "⚠"))
