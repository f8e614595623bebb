"""Devices: deflections become rates, rates poses; gamepads of SDL, reports of a 3-D mouse."""

import struct
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from present import present
from teleop_core.base.errors import SessionError
from teleop_core.commands.cli import main
from teleop_core.hand.devices import NOTHING, DeviceReading, pilot, spacemouse
from teleop_core.hand.devices.gamepad import Gamepad
from teleop_core.hand.operators import OPERATORS
from teleop_core.hand.operators.remote import AHEAD, RemoteHand
from teleop_core.hand.operators.rest import rest_pose
from teleop_core.kernels.geometry import Array
from virtual_pad import VirtualPad

DT = 1e-3
LIVE = ["gamepad", "spacemouse"]
rate = st.floats(-1.0, 1.0)
six = st.lists(rate, min_size=6, max_size=6).map(np.array)
int16 = st.integers(-(2**15), 2**15 - 1)


class Session:
    """A pilot who looks at 100 Hz, and the hand that it tells, at 1000 Hz."""

    def __init__(self, room: tuple[Array, Array] | None = None, **parameters: Any) -> None:
        self.hand = RemoteHand(room=room)
        self.pilot = pilot.Pilot(self.hand, pilot.PilotParameters(**parameters))
        self.rows, self._looks = np.zeros((0, 13)), 0

    def for_time(self, duration: float, reading: DeviceReading) -> Array:
        for _ in range(round(duration / DT / AHEAD)):
            while self._looks * 0.01 <= len(self.rows) * DT:
                self.pilot.step(reading, 0.01)
                self._looks += 1
            times: Any = (len(self.rows) + 1 + np.arange(AHEAD)) * DT
            self.rows = np.vstack((self.rows, self.hand.motion(times)))
        return self.rows


@given(six, st.floats(0.0, 0.9))
def test_a_dead_zone_takes_rest_and_gives_all_directions_alike(rates: Array, zone: float) -> None:
    found = pilot.beyond(rates, zone)
    assert (found[np.abs(rates) <= zone] == 0.0).all()
    assert (np.abs(found) <= 1.0).all()
    assert (found * rates >= 0.0).all()
    np.testing.assert_array_equal(pilot.beyond(-rates, zone), -found)
    assert (np.abs(pilot.beyond(np.sign(rates), zone)) == np.abs(np.sign(rates))).all()


@given(st.floats(0.0, 0.9), st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_more_deflection_is_never_less_speed_and_nothing_jumps(zone: float, first: float, second: float) -> None:
    low, high = pilot.beyond(np.sort([first, second]), zone)
    assert 0.0 <= high - low <= (abs(second - first) + 1e-12) / (1.0 - zone) + 1e-12


@pytest.mark.parametrize("axis", range(3))
def test_full_deflection_moves_the_stylus_at_the_stated_speed(axis: int) -> None:
    run, rates = Session(speed=0.03), np.zeros(6)
    rates[axis] = -1.0
    rows = run.for_time(1.0, DeviceReading(rates, is_held=True))
    speed = (rows[-1, axis] - rows[-201, axis]) / 0.2
    assert speed == pytest.approx(-0.03, rel=0.02)
    assert np.abs(np.delete(rows[:, :6], axis, axis=1)).max() < 1e-12


@pytest.mark.parametrize("axis", range(3))
def test_full_deflection_turns_the_stylus_about_axes_of_the_base(axis: int) -> None:
    run, rates = Session(turn_speed=0.5), np.zeros(6)
    rates[3 + axis] = 1.0
    run.for_time(1.2, DeviceReading(rates, is_held=True))
    w, x, y, z = run.hand.pose[3:]
    start = Rotation.from_quat(rest_pose()[[4, 5, 6, 3]])
    turned = (Rotation.from_quat([x, y, z, w]) * start.inv()).as_rotvec()
    assert turned[axis] == pytest.approx(0.5 * (1.2 - 0.045), abs=0.01)
    assert np.abs(np.delete(turned, axis)).max() < 1e-9


@given(six)
def test_nothing_moves_unless_the_person_holds_on(rates: Array) -> None:
    rows = Session().for_time(0.4, DeviceReading(rates))
    assert (rows[:, :6] == 0.0).all()
    assert (rows[:, 6] == 1.0).all()


def test_letting_go_presses_the_clutch_within_a_look_and_a_new_grip_does_not_jump() -> None:
    run, away = Session(), DeviceReading(np.array([1.0, 0, 0, 0, 0, 0]), is_held=True)
    run.for_time(0.5, away)
    assert run.rows[-1, 6] == 0.0
    count = len(run.rows)
    run.for_time(1.0, NOTHING)
    assert run.rows[count + 20 :, 6].min() == 1.0
    there, count = run.rows[-1, :3].copy(), len(run.rows)
    run.for_time(0.3, DeviceReading(np.zeros(6), is_held=True))
    np.testing.assert_allclose(run.rows[count:, :3], np.tile(there, (300, 1)), atol=1e-9)
    assert (run.rows[count + 20 :, 6] == 0.0).all()


def test_who_steers_into_the_end_of_the_workspace_leaves_it_at_once() -> None:
    rest = rest_pose()[:3]
    run = Session(room=(rest - 0.01, rest + 0.01), speed=0.1)
    out, back = np.array([1.0, 0, 0, 0, 0, 0]), np.array([-1.0, 0, 0, 0, 0, 0])
    run.for_time(2.0, DeviceReading(out, is_held=True))
    assert run.rows[-1, 0] == pytest.approx(0.01, abs=1e-6)
    run.for_time(0.15, DeviceReading(back, is_held=True))
    assert run.rows[-1, 0] < 0.002


def test_each_press_of_a_button_is_one_press_of_the_hand() -> None:
    run = Session()
    for _ in range(3):
        run.for_time(0.3, DeviceReading(np.zeros(6), fixture=True))
        run.for_time(0.3, DeviceReading(np.zeros(6), mode=True))
    for column in (7, 8):
        assert (np.diff(run.rows[:, column], prepend=0.0) > 0.0).sum() == 3


@pytest.mark.parametrize("name", LIVE)
def test_no_device_is_told_in_one_line_that_lists_what_was_found(name: str) -> None:
    pytest.importorskip("pygame" if name == "gamepad" else "hid")
    operator = OPERATORS.find(name)
    parameters: Any = operator.parameters(device="no such thing")
    with pytest.raises(SessionError, match=r"^no .*'no such thing' in its name; found: [^\n]+$"):
        present(operator.opens)(parameters)


# -- the jaw ---------------------------------------------------------------------------------------


def closed(run: Session, share: float | None) -> float:
    """How far the hand closes the jaw a tenth of a second after the device said a share."""
    return run.for_time(0.1, DeviceReading(np.zeros(6), jaw=share))[-1, 12]


def test_the_jaw_is_closed_as_far_as_the_device_says_whether_the_stylus_is_held_or_not() -> None:
    run = Session()
    assert [closed(run, share) for share in (0.0, 0.4, 1.0, 0.2)] == [0.0, 0.4, 1.0, 0.2]
    assert [closed(run, share) for share in (1.5, -0.5)] == [1.0, 0.0]


def test_a_device_that_comes_back_opens_the_jaw_only_after_it_was_closed_as_far_as_before() -> None:
    run = Session()
    assert closed(run, 0.8) == 0.8
    run.pilot.lose()
    assert [closed(run, share) for share in (0.0, 0.7)] == [0.8, 0.8]
    assert [closed(run, share) for share in (0.9, 0.0)] == [0.9, 0.0]


def test_a_device_that_leads_no_jaw_and_one_that_says_no_number_leave_it_as_it_is() -> None:
    run = Session()
    closed(run, 0.8)
    assert closed(run, None) == 0.8
    run.hand.close(np.nan)
    assert closed(run, None) == 0.8


# -- 3-D mouse -------------------------------------------------------------------------------------


@given(st.lists(int16, min_size=6, max_size=6))
def test_both_forms_of_reports_say_the_same(numbers: list[int]) -> None:
    long, short = spacemouse.Reports(), spacemouse.Reports()
    assert long.take(struct.pack("<B6h", 1, *numbers))
    assert short.take(struct.pack("<B3h", 1, *numbers[:3]))
    assert short.take(struct.pack("<B3h", 2, *numbers[3:]))
    np.testing.assert_array_equal(long.deflection, short.deflection)
    assert np.abs(long.deflection).max() <= 1.0
    small = np.abs(numbers) <= 350
    np.testing.assert_allclose(long.deflection[small], np.array(numbers)[small] / 350.0)


@given(six, six)
def test_axes_of_the_mouse_and_of_the_master_are_turned_and_not_mirrored(first: Array, second: Array) -> None:
    assume(np.linalg.norm(np.cross(first[:3], second[:3])) > 1e-3)
    reports = [spacemouse.Reports(), spacemouse.Reports(), spacemouse.Reports()]
    deflections = (first[:3], second[:3], np.cross(first[:3], second[:3]))
    for one, place in zip(reports, deflections, strict=True):
        one.deflection[:] = np.tile(place, 2)
    a, b, c = (one.rates()[:3] for one in reports)
    np.testing.assert_allclose(np.cross(a, b), c, atol=1e-12)
    for one in reports:
        np.testing.assert_array_equal(one.rates()[:3], one.rates()[3:])


def test_pulling_the_cap_up_and_towards_the_person_moves_the_stylus_so_and_buttons_are_bits() -> None:
    up, near, right = spacemouse.Reports(), spacemouse.Reports(), spacemouse.Reports()
    up.take(struct.pack("<B3h", 1, 0, 0, -350))
    near.take(struct.pack("<B3h", 1, 0, 350, 0))
    right.take(struct.pack("<B3h", 1, 350, 0, 0))
    np.testing.assert_array_equal(up.rates()[:3], [0.0, 1.0, 0.0])
    np.testing.assert_array_equal(near.rates()[:3], [0.0, 0.0, 1.0])
    np.testing.assert_array_equal(right.rates()[:3], [1.0, 0.0, 0.0])
    for bits in (1, 2, 3, 0):  # buttons
        assert right.take(bytes([3, bits, 0]))
        assert right.buttons == bits


@given(st.binary(max_size=16))
def test_no_bytes_are_more_than_a_full_deflection(data: bytes) -> None:
    reports = spacemouse.Reports()
    before = reports.deflection.copy(), reports.buttons
    is_taken = reports.take(data)
    assert np.isfinite(reports.deflection).all()
    assert np.abs(reports.rates()).max() <= 1.0
    if not is_taken:
        np.testing.assert_array_equal(reports.deflection, before[0])
        assert reports.buttons == before[1]


def test_mice_of_the_maker_and_its_old_ones_of_another_are_known_and_plain_mice_are_not() -> None:
    assert spacemouse.is_space_mouse(0x256F, 0xC635)
    assert spacemouse.is_space_mouse(0x046D, 0xC626)
    assert not spacemouse.is_space_mouse(0x046D, 0xC077)


# -- gamepad ---------------------------------------------------------------------------------------


@pytest.fixture
def pad() -> Iterator[VirtualPad]:
    pytest.importorskip("pygame")
    from virtual_pad import VirtualPad

    made = VirtualPad()
    yield made
    made.unplug()


@pytest.fixture
def gamepad(pad: VirtualPad) -> Iterator[Gamepad]:
    from teleop_core.hand.devices.gamepad import Gamepad

    made = Gamepad("virtual")
    yield made
    made.close()


def test_a_gamepad_at_rest_says_nothing(gamepad: Gamepad) -> None:
    reading = gamepad.read()
    assert (pilot.beyond(reading.rates, 0.12) == 0.0).all()
    assert reading[1:] == (False, False, False, None)


@pytest.mark.parametrize(
    ("axis", "share", "rates"),
    [
        ("left x", 1.0, [1, 0, 0, 0, 0, 0]),
        ("left y", -1.0, [0, 0, -1, 0, 0, 0]),
        ("right y", -1.0, [0, 1, 0, 0, 0, 0]),
        ("right x", 1.0, [0, 0, 0, 0, -1, 0]),
        ("left trigger", 1.0, [0, 0, 0, 0, 0, 1]),
        ("right trigger", 1.0, [0, 0, 0, 0, 0, -1]),
    ],
)
def test_each_stick_of_a_gamepad_moves_or_turns_along_its_axis(
    pad: VirtualPad, gamepad: Gamepad, axis: str, share: float, rates: list[int]
) -> None:
    pad.move(axis, share)
    np.testing.assert_allclose(gamepad.read().rates, rates, atol=1e-4)


def test_buttons_of_a_gamepad(pad: VirtualPad, gamepad: Gamepad) -> None:
    for button, place in (("left shoulder", 1), ("right shoulder", 1), ("a", 2), ("b", 3)):
        pad.press(button)
        pressed = gamepad.read()[1:4]
        assert pressed == tuple(place == k for k in (1, 2, 3))
        pad.press(button, is_pressed=False)
        assert not any(gamepad.read()[1:])
    pad.press("up")
    assert gamepad.read().rates[3] == -1.0


def test_the_right_trigger_closes_the_jaw_where_that_is_wanted_and_rolls_no_more(pad: VirtualPad) -> None:
    from teleop_core.hand.devices.gamepad import GamepadParameters, open_gamepad

    made = open_gamepad(GamepadParameters(device="virtual", triggers="jaw"))
    try:
        for trigger, share, jaw in (("left", 1.0, 0.0), ("right", 0.0, 0.5), ("right", 1.0, 1.0)):
            pad.move(f"{trigger} trigger", share)
            assert made.read().jaw == pytest.approx(jaw, abs=1e-3)
            assert made.read().rates[5] == 0.0
    finally:
        made.close()


def test_a_gamepad_that_is_unplugged_is_gone(pad: VirtualPad, gamepad: Gamepad) -> None:
    assert gamepad.read() is not None
    pad.unplug()
    with pytest.raises(SessionError, match="is disconnected"):
        gamepad.read()


def test_the_command_lists_what_is_there(pad: VirtualPad, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["devices"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert "gamepad      Virtual Controller" in lines
    assert lines[-1].startswith("spacemouse")
