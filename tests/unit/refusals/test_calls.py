"""Calls with what cannot be: refused in one line that names the value, by the class of the error."""

import math
import re
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest

import teleop_core as tc
from teleop_console import choices
from teleop_console.guard import Guard
from teleop_console.server import listen
from teleop_core.bags.recording import RecordingParameters
from teleop_core.base import TeleopError, build
from teleop_core.coupling.filters.tremor_filter import TremorFilterParameters
from teleop_core.coupling.fixtures.remote_centre import RemoteCentreParameters
from teleop_core.coupling.mapping.gains import FixtureParameters
from teleop_core.coupling.mapping.jaw_command import JawCommandParameters
from teleop_core.graph.graph import Delay
from teleop_core.hand.master.master_bridge import POSE_MESSAGES, MasterBridgeParameters
from teleop_core.hand.operators import OPERATORS, Setting
from teleop_core.hand.operators.behaviour import OperatorParameters
from teleop_core.hand.operators.behaviour import PressParameters as HandButtons
from teleop_core.hand.operators.human import HumanParameters
from teleop_core.hand.operators.remote import RemoteHand
from teleop_core.hand.operators.shapes import PHASES
from teleop_core.hand.operators.tour import TourParameters
from teleop_core.hand.tasks.insert import InsertParameters
from teleop_core.kernels.geometry import checked_array
from teleop_core.nodes.launching import COMMON, ONE_ARM, processes
from teleop_core.robots import dexterity, load_robot, parse_table, robot_from_table
from teleop_core.robots.arms.as_chain import true_chain
from teleop_core.robots.arms.rcrt1_hardware import tendon_joint_angles, tendon_motor_angles
from teleop_core.robots.bodies import Solid, bodies_of
from teleop_core.robots.drives import ENTRIES, Drives, independent_axes
from teleop_core.robots.hardware import Hardware
from teleop_core.robots.inertias import LinkInertia, check_possible
from teleop_core.robots.joint_map import JointMap
from teleop_core.robots.link_errors import LinkErrors
from teleop_core.shapes.capsule import CapsuleParameters
from teleop_core.shapes.cone import ConeParameters
from teleop_core.shapes.cylinder import CylinderParameters
from teleop_core.shapes.half_space import HalfSpaceParameters
from teleop_core.shapes.height_field import HEIGHT_FIELD, HeightFieldParameters
from teleop_core.shapes.hole import HoleParameters
from teleop_core.shapes.line import LineParameters
from teleop_core.shapes.mesh import MESH, MeshParameters
from teleop_core.shapes.path import PathParameters
from teleop_core.shapes.plane import PlaneParameters
from teleop_core.slave.bridges.jaw_bridge import JawBridgeParameters
from teleop_core.slave.jaw.parameters import GripObjectParameters, PegParameters
from teleop_core.slave.operation import OperationParameters, command_event
from teleop_core.slave.parameters import ReferenceFilterParameters
from teleop_core.slave.trajectory import cubic_move, shortest_move_time
from teleop_core.slave.world.button import ButtonParameters
from teleop_drill import drill
from teleop_lab import Study, Tuning
from teleop_lab.calibration import Measured, appendix_e, simulate
from teleop_lab.experiments import Comparison, Tolerance, absolute, factor, percent
from teleop_lab.studies import SearchRange
from teleop_lab.studies.printed import read_printed
from teleop_machines import mma_balance, mma_models, mobility
from teleop_machines.drives import electric_cylinders
from teleop_machines.three_finger_hand import Hand

TABLE: dict[str, Any] = {"name": "a", "convention": "modified", "angles": "degrees", "rows": [{"theta": "q"}]}
CHAIN = TABLE | {"rows": [{"theta": "q", "lower": -150, "upper": 150}]}
ZERO, Q, POSE = (0.0, 0.0, 0.0), np.zeros((3, 6)), np.array((0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0))
RPS3, SCARA, TOUR = load_robot("rps3"), load_robot("scara"), OPERATORS.find("tour")
BOX = LinkInertia(name="box", mass=1.0, center=np.zeros(3), inertia=np.eye(3))


def built(group: type[object]) -> Callable[..., object]:
    """Values of a group of parameters, built as from a file."""
    return lambda **values: build(group, values)


def study(changes: Any) -> object:
    whole = Study("point", {"display.latency": (0.0, 0.1)}, (1, 2), ["task.time_s"], {"teleop.duration": 1.0})
    return replace(whole, **changes).points()


def tuning(changes: Any) -> object:
    return replace(
        Tuning("coarse_box", {"coarse_gain": SearchRange(0.2, 1.0)}, (1,), "position_error_mm.rms"), **changes
    )


def printed(content: Any) -> object:
    return read_printed(content, ["task.time_s"], 2)


operator, operation, lag = built(OperatorParameters), built(OperationParameters), built(ReferenceFilterParameters)


def launched(**values: str) -> dict[str, str]:
    return {name: default for name, (default, _) in (COMMON | ONE_ARM).items()} | values


def joints(**values: object) -> object:
    return JointMap(("a", "b"), **values)  # type: ignore[arg-type]


def drives(**values: object) -> object:
    return Drives(**({name: [1.0] for name in ENTRIES} | values))  # type: ignore[arg-type]


def hardware(**values: object) -> object:
    zero = np.zeros(2)
    given = {"coulomb": zero, "bias": zero, "wander": zero, "play": zero, "coupling": np.zeros((2, 2))}
    return Hardware(**(given | values))  # type: ignore[arg-type]


def band(**values: object) -> object:
    return build(TremorFilterParameters, {"kind": "band_stop"} | {f"band_stop.{k}": v for k, v in values.items()})


def of(make: Callable[..., object], *names: str, **values: object) -> list[tuple[Callable[..., object], str]]:
    """Cases of what is made of all values and told by each name; by default one of each value, told by its own."""
    if names:
        return [(partial(make, **values), name) for name in names]
    return [(partial(make, **{name: value}), name) for name, value in values.items()]


CASES = [
    # shapes
    *of(CylinderParameters, direction=ZERO), *of(CapsuleParameters, direction=ZERO), *of(PlaneParameters, normal=ZERO),
    *of(LineParameters, direction=(0.0, 1e-200, 0.0)), *of(ConeParameters, axis=ZERO), *of(HoleParameters, axis=ZERO),
    *of(HalfSpaceParameters, normal=ZERO), *of(HoleParameters, chamfer=0.03, plate_radius=0.0075),
    *of(PathParameters, points=()), *of(PathParameters, points=(0.01, 0.0)),
    *of(PathParameters, points=(0.01, 0.0, 0.0) * 65),
    *of(ButtonParameters, stroke=0.002, contact_force=1.1), *of(ButtonParameters, stroke=0.02),
    # the hand
    *of(HandButtons, clutch=(1.0,), fixture=(1.0, 1.05), mode=(2.0, 1.95)), *of(HandButtons, clutch=(2.0, 1.0)),
    *of(HandButtons, clutch=(1.0, 2.0, 3.0), mode=(1.0, 1.1)), *of(HumanParameters, tolerance=0.05),
    *of(operator, "points", kind="points", points=()), *of(operator, "points", kind="points", points=(0.1,) * 4),
    *of(operator, "bag", kind="bag"), *of(TourParameters, points=(0.1, 0.2)), *of(InsertParameters, axis=ZERO),
    *of(MasterBridgeParameters, device_axes=("+x", "+y", "-z"), stylus_axes=("+x", "+x", "+z"), handle="scara"),
    *of(MasterBridgeParameters, "handle", pose_message=POSE_MESSAGES[-1]),
    # between hand and slave
    *of(RemoteCentreParameters, "least_depth", depth=0.01, least_depth=0.02), *of(band, "high", low=12.0, high=9.0),
    *of(RemoteCentreParameters, place=(0.0, 1.0), shaft=ZERO), *of(JawCommandParameters, closed_angle=1.0),
    # the slave
    *of(operation, reported=("stop",)), *of(operation, reported=("heartbeat",)),
    *(case for text in ("stop", "stop@", "stop@x", "go@1", "stop@-1", "stop@nan")
      for case in of(operation, events=(text,))),
    *(case for values in ({"gain": 0.2}, {"gain": 0.0}, {"pole": 20.0}, {"zero": 50.0}, {"zero": 0.0})
      for case in of(lag, "zero", **values)),
    *of(GripObjectParameters, place=(0.0, 1.0)), *of(GripObjectParameters, place=(0.0, 1.0, 0.0, 0.0, 2.0, 0.1)),
    *of(GripObjectParameters, place=(0.0,) * 21), *of(PegParameters, place=(0.0, 1.0, 2.0)),
    *of(PegParameters, place=(0.0, 1.0, 0.0, 1.002)), *of(JawBridgeParameters, scale=0.0),
    *of(joints, "joints", renamed=["c=x"]), *of(joints, "joints", renamed=["a"]),
    *of(joints, "joints", renamed=["a=b"]), *of(joints, signs=[1.0], offsets=[1.0], order=["a", "a"]),
    *of(joints, signs=[1.0, 0.5]),
    # robots and their plants
    *of(drives, speed_limit=[0.0], viscous=[-1.0], inertia=[np.inf], bandwidth=[1.0, 1.0], assumed=("mass",)),
    *of(hardware, coulomb=[-1.0, 0.0], play=[0.0], coupling=np.zeros((3, 3))),
    *of(hardware, coupling=np.ones((2, 2)), links=LinkErrors.none(3)),
    *of(hardware, "source", sources={"play": "somewhere"}), *of(hardware, "source", sources={"mass": "published: x"}),
    *of(mma_balance.ShoulderSpring, rate=0.0, anchor=math.nan), *of(mma_balance.coil, wire=-1.0, rate=1e6),
    *of(mma_balance.matching_rate, "deflection", torque_difference=0.1, deflection=0.0, lever=0.02),
    *of(mobility.degrees_of_freedom, "links", links=0, joints=0, joint_freedoms=0),
    *of(mobility.degrees_of_freedom, "joints", links=4, joints=2, joint_freedoms=2),
    *of(mobility.degrees_of_freedom, "joint_freedoms", links=4, joints=4, joint_freedoms=3),
    *of(mobility.degrees_of_freedom, "joint_freedoms", links=4, joints=4, joint_freedoms=25),
    *of(mobility.degrees_of_freedom, "space", links=4, joints=4, joint_freedoms=4, space=4),
    *of(mobility.independent_loops, "joints", links=5, joints=3),
    *of(mobility.passive_joints, "freedoms", joints=3, freedoms=4),
    # measurements
    *of(Measured, "points", joints=Q), *of(Measured, "points", joints=Q, points=np.zeros((2, 3))),
    *of(Measured, "origins", joints=Q, distances=np.zeros(3)), *of(Measured, "joints", joints=ZERO, points=Q[:, :3]),
    *of(Measured, "labels", joints=Q, distances=np.zeros(3), origins=Q, labels=("x",)),
    *of(Measured, "joints", joints=Q + np.nan, points=Q[:, :3]),
    *((partial(simulate, load_robot("rcrt1"), **values), name) for name, values in (
        ("link error", {"fit": ["d9"]}), ("choose", {"choose": "best"}), ("cnc", {"errors": ["milled"]}),
        ("NAME=NUMBER", {"errors": ["d3=much"]}), ("noise", {"noise": -1e-3}), ("ruler", {"noise": "rule"}),
        ("frame", {"noise": "ruler", "finds_frame": True}))),
    (lambda: simulate(load_robot("stewart")), "chain of links"),
    (lambda: appendix_e.published(load_robot("scara")), "appendix E measured the rcrt1"),
    # values that come in arrays or by name
    *((partial(checked_array, "q", np.zeros(shape), (3,)), "^q must have") for shape in ((2,), (2, 2, 3), (3, 1))),
    *((partial(checked_array, "q", [0.0, bad, 0.0], (3,)), "^q is.*finite") for bad in (math.nan, math.inf, -math.inf)),
    *((partial(cubic_move, np.zeros(2), np.ones(2), t, np.zeros(1)), "^move_time") for t in (0.0, -1.0, math.nan)),
    *((partial(shortest_move_time, np.zeros(2), np.ones(2), np.array([1.0, most])), "^speed_limit")
      for most in (0.0, -1.0, math.nan)),
    (partial(cubic_move, np.zeros(2), np.zeros(3), 1.0, np.zeros(1)), "end"),
    (partial(LinkErrors, a=np.zeros(2), alpha=np.zeros(3), d=np.zeros(2), theta=np.zeros(2)), "^alpha"),
    (lambda: LinkErrors.of(load_robot("rcrt1"), {"d7": 0.1}), "link error is 'd7'.*d6"),
    (lambda: LinkErrors.of(load_robot("rcrt1"), {"d3": math.inf}), "^link error d3"),
    (lambda: true_chain(load_robot("rcrt1"), LinkErrors.none(5)), "^errors is.*for 6"),
    *of(partial(replace, BOX), "center of link 'box' must have", center=np.zeros(2)),
    *of(partial(replace, BOX), "mass of link 'box'", mass=np.inf),
    *of(partial(replace, BOX), "inertia of link 'box'.*finite", inertia=np.diag([1.0, 1.0, np.nan])),
    *of(partial(replace, BOX), "symmetric", inertia=np.eye(3) + 0.1 * np.eye(3, k=1)),
    *((partial(check_possible, [replace(BOX, mass=mass)]), f"^mass of link 'box' is {mass}") for mass in (0.0, -1.0)),
    *((partial(independent_axes, np.array([1.0, inertia])), "^inertia") for inertia in (0.0, -0.1, np.nan)),
    (partial(mma_models.joints_of_model, np.zeros((2, 7)), "B"), "^q must have"),
    (partial(mma_models.joints_of_model, np.zeros(7), "D"), "^model is 'D'"),
    (partial(mma_models.model_table, "D", {}), "^model is 'D'"),
    (partial(Hand({}).finger_solutions, 4, np.zeros(3)), "finger"),
    (partial(Hand({}).contact_points, np.zeros(8)), "^q "),
    (partial(Hand({}).object_pose, np.zeros((3, 3))), "points"), (partial(Hand({}).contacts_of, np.zeros((4, 4))), "T"),
    (partial(RemoteHand().press, "gripper"), "clutch, fixture, mode"),
    # chains of joints, and their drives
    *((partial(robot_from_table, TABLE | {"rows": rows}), f"^{name} is") for rows, name in (
        ([], "rows"), ("theta", "rows"), ([{"a": 1.0}], "rows"), ([3], "row 1"),
        ([{"theta": "q", "alpha": math.nan}], "row 1 alpha"), ([{"theta": "q", "a": True}], "row 1 a"),
        ([{"theta": "q", "a": [1]}], "row 1 a"), ([{"theta": "q", "a": 1e6}], "row 1 a"),
        *(([{"theta": theta}], "row 1 theta") for theta in ("p", "2 q", "q + .", "q - 1e")),
        ([{"alpha": "q"}], "row 1 alpha"), ([{"theta": "q", "d": "q"}], "row 1 d"), ([{"d": "q"}], "row 1 lower"),
        ([{"theta": "q", "upper": 999999}], "row 1 upper"),
        ([{"theta": "q", "lower": 10, "upper": -10}], "row 1 lower"),
        ([{"theta": "q", "lower": -10, "upper": 10, "home": 20}], "row 1 home"),
        ([{"theta": "q"}, {"a": 1.0, "lower": 0.0}], "row 2"), ([{"theta": "q", "twist": 3}], "row 1 entry"),
        ([{"theta": "q", "name": "yaw"}, {"a": 1.0, "theta": "q", "name": "yaw"}], "rows"))),
    *((partial(parse_table, table), words) for table, words in (
        (None, "^table is None"), ([], "^table is"), ({"convention": "modified", "rows": [{"theta": "q"}]}, "^name is"),
        (TABLE | {"name": 3}, "^name is 3"), (TABLE | {"convention": "distant"}, "one of: standard, modified"),
        (TABLE | {"angles": "grad"}, "radians, degrees"), (TABLE | {"task": ["up"]}, "^task is 'up'"),
        (TABLE | {"task": []}, "^task is"), (TABLE | {"row": []}, "one of: rows, name"))),
    *((partial(robot_from_table, CHAIN | {"drives": wrong}), f"^{re.escape(name)} is") for wrong, name in (
        ([1.0], "drives"), ({"q9": {}}, "drives joint"), ({"q1": 3.0}, "drives q1"),
        ({"q1": {"mass": 1.0}}, "drives q1 entry"), ({"q1": {"inertia": 0.0}}, "drives q1 inertia"),
        ({"q1": {"coulomb": -1.0}}, "drives q1 coulomb"), ({"q1": {"speed_limit": True}}, "drives q1 speed_limit"),
        ({"q1": {"speed_limit": "fast"}}, "drives q1 speed_limit"), ({"q1": {"bandwidth": 1e4}}, "drives q1 bandwidth"),
        ({"q1": {"inertia": 1e-6, "viscous": 1.0}},
         "drives q1 (viscous + coulomb / friction_speed) / inertia"))),
    *of(partial(replace, robot_from_table(CHAIN)), home=[3.0], lower=[3.0], upper=[np.nan]),
    *of(partial(replace, robot_from_table(CHAIN)), "^home must have", home=[0.0, 0.0]),
    *of(partial(replace, robot_from_table(CHAIN)), "^drives must have", drives=electric_cylinders(2)),
    (partial(load_robot, "r2d2"), "one of: .*rcrt1"), (partial(load_robot, "cubes.xml", drive="magic"), "effort"),
    (partial(load_robot, "mma", d7=-0.03507, d9=-0.03840), "^d7 is"),  # signed offsets have no closed form
    *((partial(convert, np.zeros(2), **{name: ratio}), f"^{name} is") for name in ("ratio5", "ratio6")
      for convert in (tendon_motor_angles, tendon_joint_angles) for ratio in (0.0, math.nan)),
    # sessions step by step, and commands
    *((lambda move=move: tc.Session().command(**move), words) for move, words in (
        ({"place": [0.0, 0.0]}, "place"), ({"place": [0.5, 0.0, 0.0]}, "-0.08 to 0.08"),
        ({"place": [np.nan, 0.0, 0.0]}, "x"), ({"place": [0.0] * 3, "jaw": 2.0}, "jaw"))),
    (lambda: tc.Session(period=0.0005), "period"),
    (lambda: tc.Session().values("slave/pose"), "one of: slave/servo_jp"), (partial(command_event, "go"), "enable"),
    (partial(drill.chosen, ("kill_slave_simm",), is_composed=False), "kill_slave_sim"),
    *((partial(Delay.parse, f"slave/servo_jp{text}"), rf"^teleop.delays is 'slave/servo_jp{text}'.*servo_jp=0\.02")
      for text in ("", "=", "=soon", "=-0.1", "=nan", "=61")),
    (partial(Delay.parse, "=0.1"), "^teleop.delays is '=0.1'"),
    *of(RecordingParameters, "topic=n", every_of=("slave/measured_js",)),
    *of(RecordingParameters, "topic=n", every_of=("slave/measured_js=0",)),
    *((partial(part.numbers, group), rf"^{part.name}\.file is.*a file with")
      for part, group in ((HEIGHT_FIELD, HeightFieldParameters()), (MESH, MeshParameters()))),
    *((partial(processes, launched(**{name: value})), name)
      for name, value in (("log_level", "loud"), ("record", "perhaps"), ("processes", ""))),
    (partial(TOUR.make, TourParameters(), Setting(OperatorParameters(), np.zeros(PHASES), 1)), "at least one point"),
    # arms
    *((partial(call, q), told) for call in (RPS3.fk, RPS3.solve_fk, RPS3.fk_all, RPS3.follow_fk, RPS3.jacobian)
      for q, told in (([1.2, math.nan, 1.2], "is"), ([1.2, 1.2], "must have shape"))),
    (partial(RPS3.fk_all, np.ones((2, 3))), "must have shape"),
    (partial(RPS3.solve_fk, np.ones((2, 3)), np.tile(np.eye(4), (3, 1, 1))), "must have shape"),
    (partial(RPS3.solve_fk, RPS3.home, 2.0 * np.eye(4)), "rigid"),
    (partial(RPS3.fk, [RPS3.home, [0.1, 0.1, 5.0]]), r"q\[1\].*solve_fk"),
    (partial(RPS3.jacobian, [0.1, 0.1, 5.0]), "^q is"),
    *((partial(dexterity.sample_workspace, SCARA, count, np.random.default_rng(0)), "count") for count in (0, 10**12)),
    *((partial(dexterity.singular_values, SCARA, [0.0, 1.0, 0.1, 0.0], length), "^length is")
      for length in (0.0, math.nan)),
    (partial(bodies_of(tc.load_robot("rcrt1")).poses, np.zeros(5)), r"\(6,\)"),
    (partial(Solid, "box", (1.0, 2.0), POSE, "link"), "must have shape"),
    (partial(Solid, "sphere", (-1.0,), POSE, "link"), "^size of a sphere is"),
    (partial(Solid, "sphere", (1.0,), np.zeros(3), "link"), "must have shape"),
    *((partial(parse_table(TABLE).link_transforms, q), words)
      for q, words in (([0.0, 1.0], "must have shape"), ([math.nan], "is"))),
    # the console
    *((partial(Guard, 8080, token), "token") for token in ("", "two words", "a;b", "a&b", "a=b", "ä", 'a"b', "a\nb")),
    *((partial(listen, "127.0.0.1", port), f"^port is {port}") for port in (65536, -1)),
    *((partial(listen, host, 0), f"^host is '{host}'") for host in ("192.0.2.1", "no such host")),
    *((partial(choices.checked, words), f"^{told} is") for words, told in (
        ({"shell": "x"}, "field"), ({"robot": "a\nb"}, "robot"), ({"robot": "x" * 501}, "robot"),
        ({"robot": "/etc/passwd"}, "robot"), ({"plant": "[ideal, file=x]"}, "plant"),
        ({"robot": "a.urdf", "tip": "x, drives=y.yaml"}, "tip"))),
    # experiments and studies
    (lambda: Tolerance("near", 1.0), "^kind is"), *((make, "^amount is") for make in (
        partial(percent, 0.0), partial(absolute, math.nan), partial(factor, 1.0), partial(Tolerance, "exact", 0.1))),
    (partial(Comparison, quantity="q", predicted=math.inf), "^predicted of q is"),
    *((partial(study, changes), words) for changes, words in (
        ({"swept": {"display.latenzy": (0.0,)}}, "display.latency"),
        ({"swept": {"display.latency": (5.0,)}}, "display.latency"),
        ({"swept": {"display.latency": ()}}, "at least one value"),
        ({"swept": {"display.latency": (0.1, 0.1)}}, "differ"), ({"metrics": ["task.tme_s"]}, "task.time_s"),
        ({"metrics": []}, "key of a score"), ({"metrics": ["session.scenario"]}, "key of a score"),
        ({"metrics": ["jaw.grips"]}, "no stage writes slave/jaw/grip"),
        ({"metrics": ["insertion.depth_mm"]}, "which has no insertion"), ({"seeds": (-1,)}, "whole numbers >= 0"),
        ({"seeds": (1, 10**50)}, "at most 18 digits"),
        *(({"seeds": range(n)}, f"sessions of a study is {2 * n}, must be at most 1000000") for n in (10**9, 600_000)),
        ({"settings": {"world": "sphere", "world.place": (9.0, 0.0, 0.0)}}, "within reach .* no nearer than 8"))),
    *((partial(tuning, changes), words) for changes, words in (
        ({"searched": {}}, "at least one parameter"), ({"metric": "task.tim"}, "task.time_s"),
        ({"searched": {"coarse_gian": SearchRange(0.1, 1.0)}}, "coarse_gain"),
        ({"searched": {"coarse_gain": SearchRange(1.0, 0.1)}}, "low below high"),
        ({"searched": {"coarse_gain": SearchRange(0.0, 1.0, is_log=True)}}, "above 0 with log"),
        ({"searched": {"coarse_gain": SearchRange(0.1, 1000.0)}}, "10"))),
    *((partial(printed, content), words) for content, words in (
        ({"source": "people", "task.time_s": [1.0, 2.0]}, "two or more"),
        ({"people": 5, "task.time_s": [1.0, 2.0]}, "source"),
        ({"source": "people", "people": 5, "task.error_share": [1.0, 2.0]}, "one of the study's metrics: task.time_s"),
        *(({"source": "people", "people": 5, "task.time_s": values}, "one for each condition")
          for values in ([1.0], ["late", 2.0], 2.0)))),
    *((partial(build, FixtureParameters, {f"{name}.parts": parts}), words) for name in ("union", "intersection")
      for parts, words in (
        ((), "1 to 8 parts"), (("sphere",) * 9, "1 to 8 parts"), (("sphere", "tube radius=0.02"), r"parts\[1\]"),
        *((parts, "begins with one of box, capsule") for parts in (("sphere", "union"), ("not", "sphere"))),
        (("sphere diameter=0.02", "box"), "radius"), (("sphere radius=2.0", "box"), r"parts\[0\] radius"),
        (("sphere radius=wide", "box"), "a number, numbers in brackets"),
        (("sphere radius='wide'", "box"), r"parts\[0\] radius"), (("sphere 0.02", "box"), "then settings such as"),
        (("sphere", "box at=[0.01, 0.0]"), r"parts\[1\] at"), (("sphere", "box at=['a', 0, 0]"), r"parts\[1\] at"))),
    (partial(RemoteHand().want, np.zeros((2, 7))), r"pose must have shape \(7,\), has \(2, 7\)"),
]  # fmt: skip


@pytest.mark.parametrize(("make", "name"), CASES)
def test_what_no_part_can_be_made_of_is_refused_by_name_in_one_line(make: Callable[[], object], name: str) -> None:
    with pytest.raises(TeleopError, match=name) as refused:
        make()
    assert "\n" not in str(refused.value)
