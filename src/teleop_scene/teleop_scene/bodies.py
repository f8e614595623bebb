"""Stage ``scene``: what a scene does beyond its arms: poses of its bodies, energy, and the jaws of its grippers.

A session with the plant ``scene`` has this stage by itself. It shares the running model with ``slave_sim`` of the same
process. Each arm has its own: the first one writes the poses and energies of the whole scene, each one moves the jaw of
its own arm.
"""

import numpy as np

from teleop_core.graph import Row, RunningStage, Stage, assign, topics
from teleop_core.kernels import Array, Fields, kernel, record
from teleop_core.kernels.fields import Integers
from teleop_core.kernels.memory import call
from teleop_core.robots import load_robot_set
from teleop_scene.arm import SceneRobot
from teleop_scene.jaw import Jaw, jaw_of
from teleop_scene.models import moving_bodies
from teleop_scene.parameters import SceneParameters
from teleop_scene.scene import SceneState, address_of, shared


class SceneBodiesState(Fields):
    """State record of the stage."""

    ticks: int
    every_ns: int  # time from one message to the next [ns]
    slot: int  # number of the last message
    is_first: int  # whether the stage writes poses and energies
    place: int  # address of the C function that computes the poses of the bodies
    has_jaw: int
    upper: float  # [rad]


class SceneBodiesRow(Row):
    """Signals of the stage."""

    scene_poses: Array
    scene_energy: Array


@kernel
def world_step(
    s: SceneState,
    own: SceneBodiesState,
    bodies: Integers,
    arrays: tuple[Array, Array, Array, Array],
    jaw: tuple[Integers, Array, Array, Array],
    row: SceneBodiesRow,
    dt: float,
) -> None:
    """One tick: command the jaw, report its angle, and now and then the poses of the bodies.

    Args:
        s: State of the scene.
        own: State of the stage; written.
        bodies: Bodies with joints.
        arrays: Positions (nbody, 3) and quaternions (nbody, 4) of the bodies; energies (2,); positions of joints (nq,).
        jaw: Actuators of the jaw's joints and places of their positions (2, m); positions of closed and open joints
            (2, m); ratios of control to position (m,). The last array contains the scene's controls (nu,); written.
        row: Signals.
        dt: Tick [s].
    """
    if own.has_jaw != 0:
        places, ends, gears, control = jaw
        opening = 1.0
        if row.slave_jaw_setpoint_js_ns > topics.NO_COMMAND_NS:
            opening = min(max(row.slave_jaw_setpoint_js[0] / own.upper, -1.0), 1.0)
            for i in range(places.shape[1]):
                control[places[0, i]] = gears[i] * (ends[0, i] + opening * (ends[1, i] - ends[0, i]))
        share = (arrays[3][places[1, 0]] - ends[0, 0]) / (ends[1, 0] - ends[0, 0])
        before = row.slave_jaw_measured_js[0]
        row.slave_jaw_measured_js[0] = own.upper * share
        row.slave_jaw_measured_js[1] = (own.upper * share - before) / dt if own.ticks > 0 else 0.0
    slot = row.now_ns // own.every_ns
    if own.is_first != 0 and slot != own.slot and s.is_lost == 0:
        own.slot = slot
        call(own.place, s.model, s.data, 0, 0)
        for k in range(bodies.shape[0]):
            for i in range(3):
                row.scene_poses[7 * k + i] = arrays[0][bodies[k], i]
            for i in range(4):
                row.scene_poses[7 * k + 3 + i] = arrays[1][bodies[k], i]
        row.scene_energy[0], row.scene_energy[1], row.scene_energy[2] = arrays[2][1], arrays[2][0], s.work
    own.ticks += 1


@kernel
def rest(row: SceneBodiesRow, dt: float) -> None:
    """One tick of a stage without a scene: nothing moves."""


class SceneBodies(RunningStage):
    """Stage of the bodies of a scene; with a robot that is no arm of a scene it does nothing.

    Raises:
        ParameterError: A joint of the jaw is unknown, or has no position actuator.
    """

    def __init__(self, stage: Stage, parameters: SceneParameters, dt: float) -> None:
        robot = load_robot_set(parameters.robot, parameters.geometry)
        super().__init__(stage, robot.n, dt)
        self._row, self.state, self.robot = self.signals.copy(), record(SceneBodiesState), robot
        if not isinstance(robot, SceneRobot):
            self.scene, self.kernel = None, rest
            return
        scene = shared(robot.file, dt, f"{robot.chain.tip} world")
        self.scene, model, data, own = scene, scene.model, scene.data, self.state
        own["every_ns"] = round(1e9 / parameters.rate)
        own["is_first"], own["place"] = scene.claim("poses"), address_of("mj_kinematics")
        own["upper"] = parameters.jaw_upper
        self.jaw = found = jaw_of(model, robot, parameters.jaw, parameters.jaw_open)
        own["has_jaw"] = found is not None
        if found is not None:
            scene.place(found.joints, found.ends[1])
            scene.reset()
        jaw = Jaw.none() if found is None else found
        bodies = np.array(moving_bodies(model)[: topics.POSES], np.int64)
        arrays = (data.xpos, data.xquat, data.energy, data.qpos)
        self.kernel = world_step
        self.arguments = (
            scene.state, own, bodies, arrays, (jaw.places, jaw.ends, jaw.gears, data.ctrl if model.nu else np.zeros(1))
        )  # fmt: skip
        self.reset()

    def concerns(self) -> list[str]:
        """Report a stage whose arm is in another process, so that nothing moves here."""
        if self.scene is None or not isinstance(self.robot, SceneRobot):
            return [f"robot {self.robot.name} is no arm of a scene"]
        if self.scene.has(self.robot.chain.tip):
            return []
        return ["the scene stands still: it must be in the process of slave_sim, as by side or with --composed"]

    def reset(self) -> None:
        """Return to the state before the first tick; the scene itself is reset by its arms."""
        assign(self.signals, self._row)
        self.state["ticks"], self.state["slot"] = 0, -1
        self.signals["slave_jaw_measured_js"][0] = self.state["upper"]
        self.signals["slave_jaw_setpoint_js_ns"] = topics.NO_COMMAND_NS
