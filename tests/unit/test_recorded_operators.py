"""Operators who follow a recording or a table: as it is, in its own time."""

import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import teleop_core as tc
from present import present
from teleop_core.bags.writer import BagWriter
from teleop_core.base.parameters import build
from teleop_core.graph.topics import HAND_JAW, MASTER_BUTTONS, MASTER_MEASURED_CP, Topic
from teleop_core.hand.operators import OPERATORS, Setting, rest
from teleop_core.hand.operators.behaviour import OperatorParameters
from teleop_core.hand.operators.shapes import PHASES
from teleop_core.kernels.geometry import Array

START_NS = 1_700_000_000_000_000_000
COUNT = 201
T = np.arange(COUNT) * 0.01
PLACES = 0.01 * np.column_stack((np.cos(T) + 5.0, np.sin(3.0 * T), T))
TURNS = Rotation.from_rotvec(np.column_stack((np.sin(T), 2.0 * T, np.cos(T))))
REST = Rotation.from_euler("x", rest.REST_TILT)
CENTER = (0.01, 0.0, 0.03)


def bag(
    path: Path,
    times: Any = T,
    pressed: dict[float, tuple[int, int, int]] | None = None,
    closed: dict[float, float] | None = None,
) -> Path:
    """Recording of the samples at their times [s]."""
    rows = np.rint(times * 100.0).astype(int)
    stamps = START_NS + np.rint(times * 1e9).astype(np.int64)
    poses = np.column_stack((PLACES[rows], TURNS[rows].as_quat(scalar_first=True)))
    given: dict[Topic, Any] = {MASTER_BUTTONS: pressed, HAND_JAW: closed}
    changes = {topic: found for topic, found in given.items() if found is not None}
    with BagWriter(path, [MASTER_MEASURED_CP, *changes], ()) as writer:
        block = {MASTER_MEASURED_CP: (stamps, poses, stamps)}
        for topic, found in changes.items():
            at = START_NS + np.rint(np.array(list(found)) * 1e9).astype(np.int64)
            block[topic] = (at, np.array(list(present(found).values()), float).reshape(len(at), -1), at)
        writer.write_block(block)
    return path


def operator(
    path: Path,
    kind: str = "bag",
    device: dict[str, tuple[float, float, float]] | None = None,
    **values: float | tuple[float, float, float],
) -> Any:
    """Operator, parameters and setting."""
    key = "bag" if kind == "bag" else "file.path"
    room = {f"device.{name}": value for name, value in (device or {}).items()}
    parameters = build(OperatorParameters, {"kind": kind, key: str(path), **room, **values})
    setting = Setting(parameters, np.zeros(PHASES), 1)
    return OPERATORS.find(kind), parameters.kind.parameters, setting


def motion(path: Path, **options: Any) -> Callable[..., Any]:
    found, parameters, setting = operator(path, **options)
    return found.make(parameters, setting)


def length(path: Path, **options: Any) -> float:
    found, parameters, setting = operator(path, **options)
    return found.length(parameters, setting)


def attitudes(rows: Array) -> Rotation:
    """Attitudes of the stylus that a motion asks for."""
    return REST * Rotation.from_rotvec(rows[:, 3:6])


def test_place_and_attitude_are_those_recorded_relative_to_the_first(tmp_path: Path) -> None:
    moved = motion(bag(tmp_path / "bag"))
    rest = moved(np.array([-1.0, 0.0, 2.0, 50.0]))  # before the first and after the last sample
    assert not rest[:2].any()
    assert np.array_equal(rest[2], rest[3])
    rows = moved(T)
    assert np.allclose(rows[:, :3], PLACES - PLACES[0], rtol=0, atol=1e-15)
    expected = TURNS * TURNS[0].inv() * REST  # turned in the axes of the master's base
    assert (expected.inv() * attitudes(rows)).magnitude().max() < 1e-7


def test_between_samples_the_hand_moves_and_turns_evenly(tmp_path: Path) -> None:
    middle = motion(bag(tmp_path / "bag"))(T[:-1] + 0.005)
    steps = 0.5 * (PLACES[1:] + PLACES[:-1]) - PLACES[0]
    assert np.allclose(middle[:, :3], steps, rtol=0, atol=1e-15)
    relative = TURNS * TURNS[0].inv() * REST
    half = Rotation.from_rotvec(0.5 * (relative[1:] * relative[:-1].inv()).as_rotvec())
    assert ((half * relative[:-1]).inv() * attitudes(middle)).magnitude().max() < 1e-7


def test_hand_waits_over_a_gap_and_not_over_a_short_one(tmp_path: Path) -> None:
    times = np.delete(T, np.r_[51:91, 120:122])  # 0.41 s and 0.03 s without samples
    moved = motion(bag(tmp_path / "bag", times))
    rows = moved(np.array([0.5, 0.6, 0.9, 0.91, 1.20]))
    assert np.array_equal(rows[0], rows[1])
    assert np.array_equal(rows[0], rows[2])
    assert np.allclose(rows[3, :3], PLACES[91] - PLACES[0], rtol=0, atol=1e-15)
    share = PLACES[119] + (PLACES[122] - PLACES[119]) / 3.0 - PLACES[0]
    assert np.allclose(rows[4, :3], share, rtol=0, atol=1e-15)


def test_slow_recordings_have_no_gaps_for_being_slow(tmp_path: Path) -> None:
    rows = motion(bag(tmp_path / "bag", T[::20]))(np.array([0.1]))  # 5 Hz
    assert np.allclose(rows[0, :3], 0.5 * (PLACES[0] + PLACES[20]) - PLACES[0], rtol=0, atol=1e-15)


def test_buttons_are_pressed_when_they_were(tmp_path: Path) -> None:
    pressed = {0.3: (1, 0, 0), 0.5: (0, 1, 0), 1.0: (0, 0, 1)}
    rows = motion(bag(tmp_path / "bag", pressed=pressed))(np.array([0.0, 0.301, 0.499, 0.501, 1.5]))
    expected = [(0, 0, 0), (1, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
    assert np.array_equal(rows[:, 6:9], expected)


def test_the_jaw_is_closed_as_far_as_it_was_recorded(tmp_path: Path) -> None:
    rows = motion(bag(tmp_path / "bag", closed={0.3: 0.25, 0.5: 1.0}))
    closed = rows(np.array([0.0, 0.299, 0.301, 0.499, 0.501, 1.5]))[:, 12]
    np.testing.assert_array_equal(closed, [0.0, 0.0, 0.25, 0.25, 1.0, 1.0])
    assert not motion(bag(tmp_path / "open"))(T)[:, 9:].any()


def test_hand_approaches_the_centre_smoothly_and_then_follows(tmp_path: Path) -> None:
    moved = motion(bag(tmp_path / "bag"), center=CENTER, approach_time=2.0)
    times = np.arange(0.0, 4.0, 1e-3)
    rows = moved(times)
    assert not rows[0].any()
    assert np.allclose(rows[1000, :3], 0.5 * np.array(CENTER), rtol=0, atol=1e-15)
    assert np.allclose(rows[2000, :3], CENTER, rtol=0, atol=1e-15)
    assert np.abs(np.diff(rows[:2001, :3], axis=0)).max() < 1.9 * 0.03 / 2.0 * 1e-3
    followed = moved(2.0 + T)
    assert np.allclose(followed[:, :3], CENTER + PLACES - PLACES[0], rtol=0, atol=1e-15)


def test_a_recording_lasts_as_long_as_it_and_its_approach(tmp_path: Path) -> None:
    path = bag(tmp_path / "bag")
    assert length(path) == pytest.approx(2.0)
    assert length(path, center=CENTER, approach_time=3.0) == pytest.approx(5.0)


@pytest.mark.parametrize(("given", "seconds"), [({}, 5.0), ({"duration": 1.5}, 1.5), ({"scenario": "coarse_box"}, 5.0)])
def test_a_session_lasts_as_long_as_what_it_follows_unless_told(given: Any, seconds: float, tmp_path: Path) -> None:
    path = bag(tmp_path / "bag")
    settings: dict[str, Any] = {"operator.center": CENTER, "operator.approach_time": 3.0}
    if duration := given.pop("duration", None):
        settings["teleop.duration"] = duration
    made = tc.configuration(operator=path, settings=settings, **given)
    assert made.groups["teleop"].duration == pytest.approx(seconds)


def test_operators_without_end_leave_the_duration_alone_and_a_length_is_asked() -> None:
    assert tc.configuration("coarse_box").groups["teleop"].duration == 46.0
    part = tc.Operator("endless", lambda parameters, setting: lambda times: times, length=3.0)  # type: ignore[arg-type]
    with pytest.raises(tc.PartError, match="length"):
        tc.register_operator("endless", part)


def test_a_motion_beyond_the_stops_is_told_with_its_share_and_what_helps(tmp_path: Path) -> None:
    device = {"workspace": (0.04, 0.04, 0.04), "start": (0.0, 0.0, 0.0)}
    path = bag(tmp_path / "bag")
    shifted = (0.025, 0.0, 0.0)
    with pytest.warns(UserWarning, match="leaves the device's workspace") as notes:
        motion(path, device=device, center=shifted)
    text = str(notes[0].message)
    beyond = np.abs(PLACES - PLACES[0] + shifted) - 0.02
    share = 100.0 * (beyond > 0.0).any(axis=1).mean()
    assert f"{share:.3g} %" in text
    assert f"{1e3 * beyond.max():.3g} mm" in text
    hint = text.partition("operator.center=")[2].partition("]")[0].strip("[")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        motion(path, device=device, center=tuple(float(part) for part in hint.split(",")))


def test_a_motion_larger_than_the_device_is_told_with_a_scale(tmp_path: Path) -> None:
    device = {"workspace": (0.01, 0.01, 0.01)}
    with pytest.warns(UserWarning, match="--scale 0.49"):
        motion(bag(tmp_path / "bag"), device=device)


def test_a_table_with_the_usual_head_is_taken_in_metres_seconds_and_radians(tmp_path: Path) -> None:
    vectors = TURNS.as_rotvec()
    rows = np.column_stack((3.0 + T, PLACES, vectors, T > 1.0))
    head = "t,x,y,z,rx,ry,rz,clutch"
    np.savetxt(tmp_path / "a.csv", rows, "%.17g", ",", header=head, comments="")
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # nothing is guessed
        got = motion(tmp_path / "a.csv", kind="file")(T + 1e-9)
    assert np.allclose(got[:, :3], PLACES - PLACES[0], rtol=0, atol=1e-8)
    expected = TURNS * TURNS[0].inv() * REST
    assert (expected.inv() * attitudes(got)).magnitude().max() < 1e-6
    assert np.array_equal(got[:, 6], T > 1.0)


def test_other_tables_are_guessed_with_a_note(tmp_path: Path) -> None:
    rows = np.column_stack((1e3 * T, 1e3 * PLACES))
    np.savetxt(tmp_path / "a.csv", rows, "%.17g", ";", header="ms;x (mm);y (mm);z (mm)", comments="")
    with pytest.warns(UserWarning, match="in ms"):
        got = motion(tmp_path / "a.csv", kind="file")(T)
    assert np.allclose(got[:, :3], PLACES - PLACES[0], rtol=0, atol=1e-12)


def test_hand_follows_a_recording_of_others_to_its_end(tmp_path: Path) -> None:
    path = bag(tmp_path / "bag")
    options: dict[str, Any] = {"operator.center": (0.0, 0.0, 0.03), "operator.approach_time": 1.0}
    recording = tc.run(operator=path, settings=options, tremor_amplitude=0.0)
    master = recording["master/measured_cp"]
    rows = np.searchsorted(master.time, master.time[-1] - 2.0 + T)
    rows = np.minimum(rows, len(master) - 1)
    got = master[["x", "y", "z"]][rows]
    # The hand lags behind by its own dynamics and friction: 0.1 s at 40 mm/s, 30 mm/s here.
    assert np.abs(got - got[0] - (PLACES - PLACES[0])).max() < 6e-3
    turn = Rotation.from_quat(master[["qw", "qx", "qy", "qz"]][rows], scalar_first=True)
    off = (TURNS * TURNS[0].inv()).inv() * (turn * turn[0].inv())
    assert off.magnitude().max() < 0.02
