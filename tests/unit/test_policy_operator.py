"""A policy as operator: it sees late, moves the hand evenly, and its mistakes are one line."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import teleop_core as tc
from teleop_core.graph.topics import TASK_STATE
from teleop_core.hand.operators.policy import POLICIES, HandOver

MOST = 1e-3  # by which hand and tip may move in 20 ms [m]
QUIET = {"operator.tremor_amplitude": 0.0}


def run(policy: object, duration: float = 2.0, scenario: str = "free_motion", **settings: Any) -> tc.Recording:
    name = f"tried_{len(POLICIES.names())}"
    POLICIES.add(name, policy)
    given = {key.replace("__", "."): value for key, value in settings.items()}
    told = QUIET | {"policy.name": name} | given
    return tc.run(scenario, duration=duration, operator="policy", settings=told)


def places(recording: tc.Recording, topic: str) -> np.ndarray:
    """Places (N, 3) [m] since the slave follows."""
    stream, state = recording[topic], recording["teleop/state"]
    begin = state.time[state["is_following"] > 0.0][0]
    return np.asarray(stream[["x", "y", "z"]][stream.time > begin])


@pytest.mark.parametrize("far", [0.004, 0.015, 0.03])
def test_a_policy_that_wants_another_place_takes_over_without_a_jump_and_gets_there(far: float) -> None:
    wanted = np.array([far, -far, 0.5 * far])
    recording = run(lambda _: wanted, duration=9.0, coarse_gain=1.0)
    for topic in ("hand/servo_cp", "slave/measured_cp"):
        way = places(recording, topic)
        assert np.linalg.norm(way[20:] - way[:-20], axis=1).max() < MOST
    hand = recording["hand/servo_cp"][["x", "y", "z"]]
    assert np.abs(hand[-1] - hand[0] - wanted).max() < 1e-9


def test_a_shift_of_a_hand_over_shrinks_as_fast_as_it_is_told_and_ends_at_zero() -> None:
    over, wanted, hand = HandOver(0.02), np.array([0.01, 0.0, 0.0]), np.zeros(3)
    found = [over.place(wanted, hand, 0.1)[0] for _ in range(8)]
    assert np.allclose(found, np.minimum(0.002 * np.arange(8), 0.01), atol=1e-15)
    over.begin()
    assert np.array_equal(over.place(-wanted, wanted, 0.1), wanted)


SCREEN = {"teleop__stages": ["display", "network"], "network__back__least_delay": 0.25, "display__latency": 0.033}


@pytest.mark.parametrize(
    ("late", "delay"), [({}, 0.0), ({"teleop__delays": ["slave/measured_cp@operator=0.3"]}, 0.3), (SCREEN, 0.283)]
)
def test_the_age_is_that_of_the_pose_that_a_policy_sees(late: dict[str, Any], delay: float) -> None:
    """Now less the age is the stamp of a recorded pose, and that pose is the one that was seen."""
    views = list[tc.View]()

    def wave(seen: tc.View) -> np.ndarray:
        views.append(seen)
        return np.array([0.01 * np.sin(3.0 * seen.time), 0.0, 0.0])

    stream = run(wave, 2.5, **late)["slave/measured_cp"]
    poses, begins = stream[["x", "y", "z"]], list[float]()
    for seen in views[20:]:
        at = int(np.abs(poses - seen.measured_cp[:3]).sum(axis=1).argmin())
        assert np.array_equal(poses[at], seen.measured_cp[:3])
        begins.append(1e-9 * float(stream.stamp_ns[at]) + seen.age - seen.time)  # when the policy's time began
    assert np.ptp(begins) < 5e-3  # four ticks at a time
    ages = np.array([seen.age for seen in views[20:]])
    assert delay - 1e-3 <= ages.min()
    assert ages.max() <= delay + 0.025  # a frame of the display, a packet, four ticks


def test_a_policy_is_asked_at_its_rate_and_the_hand_moves_evenly_in_between() -> None:
    times = list[float]()

    def jumps(seen: tc.View) -> np.ndarray:
        times.append(seen.time)
        return np.array([1e-4 * len(times), 0.0, 0.0])

    recording = run(jumps, 1.5, policy__rate=10.0)
    assert np.allclose(np.diff(times), 0.1, atol=4e-3 + 1e-9)
    place = recording["hand/servo_cp"]["x"]
    speeds = np.diff(place[place > place[0]])
    assert np.median(speeds) == pytest.approx(1e-6)  # 0.1 mm in 100 ticks
    assert speeds[200:].max() < 1.02e-6
    assert speeds.max() < 2.1e-6  # and the shift of the beginning


def test_each_session_makes_its_own_policy_and_runs_to_the_same_bits() -> None:
    class Counts:
        def __init__(self) -> None:
            self.count = 0

        def __call__(self, seen: tc.View) -> np.ndarray:
            self.count += 1
            return np.array([0.0, 1e-4 * self.count, 0.0])

    POLICIES.add("counts", Counts)
    settings = {"policy.name": "counts"}
    one, other = (tc.run("free_motion", duration=1.0, operator="policy", settings=settings) for _ in range(2))
    for topic in ("hand/servo_cp", "slave/measured_cp"):
        assert np.array_equal(one[topic][["x", "y", "z"]], other[topic][["x", "y", "z"]])


def test_a_policy_sees_the_goal_of_a_task_and_reaches_it_and_its_delay_costs_goals() -> None:
    def by_sight(seen: tc.View) -> np.ndarray:
        return seen.place if seen.goal is None else seen.place + 0.08 * seen.to_hand(seen.goal - seen.measured_cp[:3])

    def successes(late: float) -> float:
        more = {"teleop__stages": ["display", "task", "network"], "network__back__least_delay": late}
        found = run(by_sight, 8.0, "point", task="reach", **more).score().value("task.successes")
        assert found is not None
        return found

    assert successes(0.0) >= 10.0
    assert successes(0.5) <= 2.0


def test_a_place_beyond_the_hand_is_its_border_and_the_jaw_is_closed_as_told() -> None:
    corners: dict[str, Any] = {"device.workspace": [0.1, 0.08, 0.06], "device.start": [0.0, 0.0, 0.0]}
    recording = run(lambda _: np.array([9.0, 0.0, 0.0, 0.25]), 3.0, "pick", policy__give_way=1.0, **corners)
    place = recording["hand/servo_cp"]["x"]
    assert place.max() - place[0] == pytest.approx(0.05)
    assert recording["hand/jaw"].values[-1, 0] == 0.25


def wrong_shape(_: tc.View) -> Any:
    return np.zeros(2)


def no_number(_: tc.View) -> Any:
    return np.array([0.0, np.nan, 0.0])


def raises(seen: tc.View) -> Any:
    return 1.0 / (0.0 * seen.time)


def words(_: tc.View) -> Any:
    return "left"


def test_a_fixture_holds_a_policy_as_it_holds_a_person() -> None:
    def reach(size: float) -> float:
        """Farthest place of the tip from where it began [m]."""
        box: dict[str, Any] = {"fixture": "box", "fixture__box__size": [size] * 3, "operator__buttons__fixture": [0.1]}
        way = places(run(lambda _: np.array([0.0, 0.02, 0.0]), 3.0, **box), "slave/measured_cp")
        return float(np.abs(way - way[0]).max())

    free = reach(0.1)
    assert free > 0.018
    assert reach(0.01) < 0.5 * free  # a wall that gives way under the push of 10 mm


WRONG: dict[Callable[..., Any], str] = {
    wrong_shape: r"ShapeError: .*\(3,\).*\(2,\)",
    no_number: "finite numbers",
    raises: "ZeroDivisionError: float division by zero",
    words: "ValueError: could not convert string to float: 'left'",
}


@pytest.mark.parametrize("policy", WRONG)
def test_a_mistake_of_a_policy_is_one_line_that_names_it_and_its_time(policy: Callable[..., Any]) -> None:
    with pytest.raises(
        tc.PartError, match=rf"^policy 'tried_\d+' .* at [\d.]+ s it does not; it raises .*{WRONG[policy]}"
    ) as told:
        run(policy)
    assert "\n" not in str(told.value)


def test_a_policy_that_is_not_named_not_known_or_not_callable_is_refused_before_the_session() -> None:
    with pytest.raises(tc.ParameterError, match=r"operator.policy.name is '', must be the name of a policy"):
        tc.run("free_motion", duration=1.0, operator="policy")
    with pytest.raises(tc.UnknownNameError, match="no_such"):
        tc.run("free_motion", duration=1.0, operator="policy", settings={"policy.name": "no_such"})
    with pytest.raises(tc.PartError, match="'seven' must be a function of a view"):
        tc.register_policy("seven", 7)  # type: ignore[arg-type]
    with pytest.raises(tc.PartError, match="made without arguments; it raises TypeError"):
        run(HandOver.__class__)  # a class that needs arguments


def test_a_task_without_a_goal_yet_has_none() -> None:
    zeros = np.zeros(len(TASK_STATE.columns))
    view = tc.View(0.0, np.zeros(7), 0.0, np.zeros(7), np.zeros(6), np.zeros(13), zeros, np.zeros(3), 0.0, np.eye(3))
    assert view.goal is None
    assert view.gain == 1.0
    assert not view.is_following
