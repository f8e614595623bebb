"""Conformance: what is made of trails of an arm that measures, or says that it measures."""

import sys

import numpy as np
import pytest

from teleop_core.commands.cli import main
from teleop_core.kernels.geometry import Array
from teleop_core.robots import load_robot
from teleop_drill.conformance.agreement import LATEST, Trail, adds_up, follows, obeys

TIMES = np.arange(0.0, 3.0, 1e-3)
WAY = 0.01


def there_and_back(times: Array) -> Array:
    """Share of a way that begins after half a second and takes two."""
    share = np.clip((times - 0.5) / 2.0, 0.0, 1.0)
    return 0.5 * (1.0 - np.cos(2.0 * np.pi * share))


def trail(places: Array, rates: Array | None = None, times: Array = TIMES) -> Trail:
    """One joint that moves, one that rests."""
    place = np.column_stack((places, np.full(len(times), 0.3)))
    rate = np.empty((0, 0)) if rates is None else np.column_stack((rates, np.zeros(len(times))))
    return Trail(times, times, place, rate)


WANTED = trail(WAY * there_and_back(TIMES))


@pytest.mark.parametrize("lag", [0.0, 0.05, LATEST - 0.02])
def test_an_arm_that_follows_with_a_little_lag_and_a_constant_error_agrees(lag: float) -> None:
    measured = trail(0.002 + WAY * there_and_back(TIMES - lag))
    assert follows("measured_js", measured, WANTED, 1e-3) == ""


@pytest.mark.parametrize(
    ("measured", "word"),
    [
        (np.zeros(len(TIMES)), "measured_js by 0"),
        (0.5 * WAY * there_and_back(TIMES), "measured_js by 0.005"),
        (-WAY * there_and_back(TIMES), "off"),
        (WAY * there_and_back(TIMES - 0.5), "0.5 s behind"),
    ],
)
def test_an_arm_that_is_frozen_scaled_mirrored_or_late_does_not(measured: Array, word: str) -> None:
    assert word in follows("measured_js", trail(measured), WANTED, 1e-3)


def test_nothing_is_said_of_an_arm_that_was_not_moved_or_says_nothing() -> None:
    still = trail(np.zeros(len(TIMES)))
    assert follows("measured_js", still, still, 1e-3) == ""
    none = Trail(TIMES[:0], TIMES[:0], np.empty((0, 2)), np.empty((0, 0)))
    assert follows("measured_js", none, WANTED, 1e-3) == ""
    assert adds_up(none, 1e-3) == ""


@pytest.mark.parametrize(("factor", "is_right"), [(1.0, True), (2.0, False), (-1.0, False)])
def test_speeds_must_add_up_to_the_way(factor: float, is_right: bool) -> None:
    places = WAY * there_and_back(TIMES)
    speeds = factor * np.gradient(places, TIMES)
    assert (adds_up(trail(places, speeds), 1e-3) == "") is is_right


@pytest.mark.parametrize(("factor", "is_right"), [(1.0, True), (0.5, False), (0.0, False)])
def test_a_measured_tip_is_held_against_forward_kinematics(factor: float, is_right: bool) -> None:
    robot = load_robot("rcrt1")
    joints = robot.start + WAY * there_and_back(TIMES)[:, None]
    tips = np.array([robot.fk(row)[:3, 3] for row in joints])
    tip = Trail(TIMES, TIMES, tips[0] + factor * (tips - tips[0]), np.empty((0, 0)))
    told = obeys(Trail(TIMES, TIMES, joints, np.empty((0, 0))), tip, robot.fk, 1e-4)
    assert (told == "") is is_right


def test_without_the_messages_of_crtk_one_line_says_how_they_are_made(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("rclpy")
    monkeypatch.setitem(sys.modules, "crtk_msgs.msg", None)
    monkeypatch.setitem(sys.modules, "crtk_msgs", None)
    assert main(["conformance", "slave", "--read-only"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "`make crtk_msgs`" in line
