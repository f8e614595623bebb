"""Joints of a device from moves of a person, who does what the words say, by the robot's motion."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from teleop_core.base.errors import ParameterError, SessionError
from teleop_core.base.parameters import build
from teleop_core.chain.master import master_bridge
from teleop_core.chain.master.device_joints import DeviceJoints
from teleop_core.commands.map_device import mapped
from teleop_core.robots import load_robot

URDF = str(Path(__file__).parents[2] / "examples" / "any_arm.urdf")
HANDLES = [("scara", []), (URDF, ["tip=tool0"]), ("puma560", [])]
WAYS = {"forward": (1, 0, 0), "back": (-1, 0, 0), "to the left": (0, 1, 0),
        "to the right": (0, -1, 0), "up": (0, 0, 1), "down": (0, 0, -1)}  # fmt: skip
MOTIONS = {"to the right": (0, -1, 0), "up": (0, 0, 1), "towards you": (-1, 0, 0)}
"""Ways of the person's motions in the base of a handle that looks away from the person."""


class Leader:
    """A handle of other names, signs, zeros and order, and a person who does what is asked."""

    topic, message = "/leader/joint_states", master_bridge.POSE_MESSAGES[-1]

    def __init__(self, name: str, geometry: list[str], seed: int, offset: float = 1.0) -> None:
        rng = np.random.default_rng(seed)
        self.robot = load_robot(name, **dict(text.split("=") for text in geometry))
        n = self.robot.n
        self.names = [*(f"motor_{k}" for k in rng.permutation(n)), "gripper"]
        self.signs, self.offsets = rng.choice([-1.0, 1.0], n), offset * rng.uniform(0.3, 1.5, n)
        self.said: list[Any]
        self.q, self.said = self.robot.home.copy(), []

    def joints(self) -> dict[str, float]:
        theirs = self.signs * (self.q - self.offsets)
        return dict(zip(self.names, [*theirs.tolist(), 0.5], strict=True))

    def __call__(self, text: str) -> str:
        """Do what is asked; of a joint, find by small steps which way the words mean."""
        self.said.append(text)
        if found := re.match(r"move (\S+) alone, so that (.*), hold", text):
            joint = self.robot.joint_names.index(found[1])
            self.q[joint] += (
                0.3 * (self.robot.upper - self.robot.lower)[joint] * self.meant(joint, found[2])
            )
        elif found := re.match(r"move it (.*), hold", text):
            T = self.robot.fk(self.q)
            T[:3, 3] += 0.1 * np.array(MOTIONS[found[1]])
            self.q = np.array(self.robot.ik(T, seed=self.q).q)
        elif "stylus still" in text:
            self.q = self.robot.start.copy()
        return ""

    def meant(self, joint: int, words: str) -> Any:
        ways = sum(np.array(way) for name, way in WAYS.items() if name in words)
        step = np.zeros(self.robot.n)
        step[joint] = 1e-6
        before, after = self.robot.fk(self.q), self.robot.fk(self.q + step)
        if "clockwise" in words:  # for who looks along a way: right-handed about it
            turn = after[:3, :3] @ before[:3, :3].T
            moved = np.array((turn[2, 1], turn[0, 2], turn[1, 0]))
        else:
            moved = after[:3, 3] - before[:3, 3]
        return np.sign(ways @ moved)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(("name", "geometry"), HANDLES, ids=["scara", "urdf", "puma560"])
def test_the_bridge_knows_where_a_handle_is_whose_joints_a_person_moved_as_the_words_say(
    name: str, geometry: list[str], seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    leader = Leader(name, geometry, seed)
    monkeypatch.setattr("builtins.input", leader)
    text = mapped(leader, name, geometry)
    values = yaml.safe_load(text)["master_bridge"]["ros__parameters"]
    bridge = master_bridge.MasterBridge(build(master_bridge.MasterBridgeParameters, values))
    q = leader.q = leader.robot.home + np.random.default_rng(seed).uniform(-0.1, 0.1, len(leader.q))
    said = leader.joints()
    assert bridge.hear_joints(list(said), list(said.values()), 10**18, 10**18)
    x, y, z = leader.robot.fk(q)[:3, 3]
    found = np.array(bridge.signals["master_measured_cp"])[:3]
    np.testing.assert_allclose(found, (-y, z, -x), atol=1e-3)  # offsets have four decimals
    assert values["device_axes"] == ["-y", "+z", "-x"]
    assert "unit" not in values


def test_zeros_that_agree_as_well_as_a_hand_holds_a_posture_are_no_offsets(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    leader = Leader("scara", [], 0, offset=0.003)
    found = DeviceJoints(leader.robot, leader.joints())
    while found.joint:
        begin = leader.joints()
        leader(f"move {found.joint} alone, so that {found.way(begin)}, hold")
        found.take(begin, leader.joints())
    assert np.abs(found.parameters().handle_offsets).max() == 0.0


def test_a_move_that_is_none_of_the_joint_alone_is_refused_and_asked_for_again() -> None:
    robot = load_robot("scara")
    rest = dict.fromkeys(("a", "b", "c", "d"), 0.0)
    found = DeviceJoints(robot, rest)
    for end, needed in (
        ({}, "at least"), ({"a": 0.1}, "at least"), ({"a": 1.0, "b": -0.5}, "alone"),
        ({"a": 30.0}, "degrees"), ({"a": np.nan}, "at least"), ({"new": 1.0}, "at least"),
    ):  # fmt: skip
        with pytest.raises(ParameterError, match=f"move of {robot.joint_names[0]}.*{needed}"):
            found.take(rest, rest | end)
        assert found.joint == robot.joint_names[0]
    assert found.take(rest, rest | {"c": -1.0, "b": 0.2}) == "c"
    with pytest.raises(ParameterError, match=f"another joint than that of {robot.joint_names[0]}"):
        found.take(rest, rest | {"c": -1.0})
    with pytest.raises(ParameterError, match="with c"):
        found.place({"a": 0.0})


def test_a_person_who_moves_the_wrong_thing_is_told_and_asked_once_more(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    leader = Leader("scara", [], 1)
    asked = []

    def distracted(text: str) -> str:
        asked.append(text)
        return "" if len(asked) == 2 else leader(text)

    monkeypatch.setattr("builtins.input", distracted)
    mapped(leader, "scara", [])
    assert asked[1] == asked[2]
    assert "once more" in capsys.readouterr().out


def test_joints_need_a_robot_poses_take_none_and_motions_need_a_person(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    leader = Leader("scara", [], 0)
    with pytest.raises(ParameterError, match="handle"):
        mapped(leader, "", [])
    leader.message = master_bridge.POSE_MESSAGES[0]
    with pytest.raises(ParameterError, match="handle"):
        mapped(leader, "scara", [])

    def nobody(text: str) -> None:
        raise EOFError

    leader.message = master_bridge.POSE_MESSAGES[-1]
    monkeypatch.setattr("builtins.input", nobody)
    with pytest.raises(SessionError, match="person"):
        mapped(leader, "scara", [])
