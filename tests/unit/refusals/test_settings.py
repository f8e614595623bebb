"""Settings that no session can have: each is refused in one line, by its name or with what is possible."""

import re
from itertools import product

import pytest

from teleop_core.base import ParameterError, PartError, TeleopError, UnknownNameError
from teleop_core.session import virtual
from teleop_core.session.configuration import configure
from teleop_core.slave.controllers import CONTROLLERS

ARMS = "teleop.arms=[right, left]"
WAVE, YIELDS = "reflection.passivity=wave", "teleop.stages=[network,impedance,passivity]"
CASES = [
    # scenario, settings, error, words of its text
    (None, "duration", TeleopError, "key=value"), (None, "duration=[1", TeleopError, "YAML"),
    (None, "duration=soon", ParameterError, "^teleop.duration is"),
    (None, "duration=", ParameterError, "^teleop.duration is"), (None, "seed=1.5", ParameterError, "^operator.seed is"),
    (None, "operator.kind=square", ParameterError, "^operator.kind is"),
    (None, "operator.center=[0, 0]", ParameterError, "^operator.center is"),
    (None, "fine_gain=11", ParameterError, "^motion_scaling.fine_gain is"),
    (None, "fine_gain=2", ParameterError, "^fine_gain is"),  # above the coarse one
    (None, "slave_sim.robot=mma", ParameterError, "^robot is"),  # two stages for different robots
    *((None, f"operator={name}", ParameterError, rf"'{name}', must be one of random, .*remote.* in virt")
      for name in ("gamepad", "spacemouse", "elsewhere")),
    (None, "operator=observer", ParameterError, r"observer.*teleop.stages=\[task\]"),
    *((None, f"{name}=[{axes}]", ParameterError, rf"^\S*{name} is") for name in ("axes", "tool_axes")
      for axes in ("+x, +y, -z", "+z, -x, +y, +x", "+x, +x, +z", "x, y, z")),
    (None, "teleop.delays=[slave/servo_jq=0.02]", UnknownNameError, "'slave/servo_jq'.*slave/servo_jp"),
    (None, "teleop.delays=[slave/servo_jp@slaves=0.02]", UnknownNameError, "'slaves'.*slave_sim"),
    # former names
    ("coarse_box", "fixture.sphere.diameter=0.03", UnknownNameError, "fixture.sphere.radius"),
    ("coarse_box", "world.box.edges=[0.1, 0.1, 0.1]", UnknownNameError, "world.box.size"),
    ("coarse_box", "fixture=keep_out_sphere", UnknownNameError, "sphere"),
    # plants
    *((None, ("plant=hardware", setting), (ParameterError, UnknownNameError), words) for setting, words in (
        ("plant=real", "ideal, hardware"), ("plant.hardware.without=[rust]", "friction"),
        ("plant.hardware.coulomb=[1.0]", "6 values"), ("plant.hardware.coulomb=[-1.0,0,0,0,0,0]", "at least 0"),
        ("plant.hardware.weights=[m9=1]", "m2b_L0b"), ("plant.hardware.weights=[m2b_L0b=heavy]", "m2b_L0b=number"))),
    *((None, ("plant=hardware", f"plant.hardware.gear_stiffness={gears}"), ParameterError, words) for gears, words in (
        ([0.0, 0.0, 0.0, 0.0, 10.0, 0.0], "theta5.*all that it moves"),
        ([1e7, 0.0, 0.0, 0.0, 0.0, 0.0], "theta1.*1500"))),
    *((None, (f"slave_sim.{name}=[1.0, 1.0, 1.0, 1.0, 1.0]", *law), ParameterError, f"^slave_sim.{name} is")
      for name, *law in (
        ("viscous",), ("coulomb",), *((f"controller.pid.{name}", "controller=pid") for name in ("kp", "ki", "kd")),
        *((f"controller.{law}.{'kp' if law == 'source_pid' else 'bandwidth'}", f"controller={law}")
          for law in CONTROLLERS.names()))),
    ("palpation", "robot=cubes.xml", ParameterError, "has a world"),
    (None, ("robot=rcrt1", "plant=scene"), ParameterError, r"robot=SCENE\.xml"),
    # arms
    *((None, settings, TeleopError, words) for settings, words in (
        ("teleop.arms=[left, left]", "left"), ("teleop.arms=[right, 'left arm']", "left arm"),
        ((ARMS, "middle/seed=3"), "right, left"), ("left/seed=3", "left"),
        ((ARMS, "left/slave_sim.robot=mma"), "left/inverse_kinematics"),
        ((ARMS, "teleop.delays=[up/slave/servo_jp=0.1]"), "left/slave/servo_jp"))),
    # worlds and force
    *(("free_motion", settings, ParameterError, words) for settings, words in (
        ("world=plane", "mm inside"), (("world=plane", "world.plane.normal=[1.0,0.0,0.0]"), "straight below"),
        (("world=box", "world.place=[0.1,0.2]"), "x, y, z, or empty"),
        (("world=box", "robot=scara_stewart"), "given for scara_stewart"),
        (("world=plane", "world.plane.normal=[0.0,0.0,0.0]"), "a direction"),
        *((("world=box", *settings), "that of a needle") for settings in product(
            ("world=button", "world.puncture_force=1.0"), ("world.tool_points=2", "world.tool_radius=0.001"))),
        ("world.tool_points=17", "tool_points"), ("world.tool_points=0", "tool_points"),
        ("world.tool_length=0.0", "tool_length"))),
    ("palpation", ("world=button", "world.puncture_force=1.0"), ParameterError, "puncture"),
    ("palpation", WAVE, ParameterError, r"teleop.stages=\[passivity\]"),
    ("palpation", (YIELDS, WAVE), ParameterError, "none, tank, tdpa with the stage impedance"),
    *(("palpation", f"reflection.architecture={name}", ParameterError,
       rf"'{name}'.*teleop.stages=\[impedance\].*position_force") for name in ("three_channel", "four_channel")),
    ("palpation", "teleop.stages=[impedance,network]", PartError, "network, impedance"),
    ("palpation", "teleop.stages=[passivity,impedance]", PartError, "impedance, passivity"),
]  # fmt: skip


@pytest.mark.parametrize(("scenario", "settings", "error", "words"), CASES)
def test_what_no_session_can_have_is_refused_in_one_line(
    scenario: str | None, settings: str | tuple[str, ...], error: type[TeleopError], words: str
) -> None:
    with pytest.raises(error) as refused:
        virtual.VirtualTime(configure(scenario, settings=[settings] if isinstance(settings, str) else settings))
    assert re.search(words, str(refused.value)), refused.value
    assert "\n" not in str(refused.value)
