"""Arm nodes: one arm with its master on the page."""

from collections.abc import Callable
from contextlib import suppress

import numpy as np
import viser

from teleop_console.body_nodes import BodyNodes, extent
from teleop_console.cameras import corners
from teleop_console.fixture_outlines import Look, OutlineNode, scale_of, unit_outline
from teleop_console.jaw_nodes import JawNodes
from teleop_console.link import ArmView, ShownArm, box_of
from teleop_console.look import MEASURED, ROLES, TARGET, WANTED, Color
from teleop_console.master_nodes import MasterNodes
from teleop_console.poses import move
from teleop_console.stand import DEVICE, PUBLISHED_AXES, REST, stand_beside
from teleop_console.tails import LENGTH, Tail, is_jump
from teleop_console.world_nodes import WorldNodes
from teleop_core.base.errors import TeleopError
from teleop_core.graph.topics import (
    MASTER_MEASURED_CF,
    MASTER_MEASURED_CP,
    SLAVE_MEASURED_CF,
    SLAVE_MEASURED_CP,
    SLAVE_MEASURED_JS,
    SLAVE_SERVO_CP,
    SLAVE_SETPOINT_CP,
    SLAVE_SETPOINT_JS,
    TASK_STATE,
    Limit,
    Topic,
)
from teleop_core.kernels.geometry import Array
from teleop_core.robots.bodies import bodies_of
from teleop_core.robots.bodies.frames import inverse, pose_of, product
from teleop_core.robots.bodies.looks import fingers_of, looks_of
from teleop_core.robots.bodies.meshes import mesh_of
from teleop_core.robots.dexterity import sample_workspace
from teleop_core.robots.robot import Robot

Path = Callable[[Topic, str, float], tuple[Array, Array]]
"""Function of a topic, an arm and a length [s] that returns times (N,) [s] and rows (N, width) up to now."""
_AT = 1e-3
"""A joint is at its limit if its distance from the limit is below this share of its range."""
_WORK = 0.05  # free space on all sides of a tip [m]
_GRIP = 0.1  # free space on all sides of a stylus with its handles [m]
_GOAL = TASK_STATE.columns.index("goal_x")
_LEAST_GOAL = 1e-3  # smallest drawn width of a goal [m]
_NEAR = 0.4  # largest distance of a framed object from the start of the tip, divided by the robot's length
_TOUCH = 0.05  # smallest wall force that counts as a contact [N]
SHOWN = ("axes", "ghost", "reach", "paths")
"""Elements that may be shown or hidden: axes of bodies, the commanded posture, positions that the tip can reach, and
paths of the last seconds."""
_REACHED = 4000  # number of drawn positions that the tip can reach
_POINT = 0.003  # width of such a point, divided by the robot's length


class ArmNodes:
    """One arm on the page: its bodies, ghost and paths, and its master.

    Args:
        server: The page.
        arm: The arm.

    Attributes:
        bodies: Bodies of the robot.
        world: Object that the tip can touch.
        jaw: Fingers of the arm, and the objects that they grip.
        low: Lowest corner (3,) [m] of the box around arm and master, in slave_base.
        high: Highest corner (3,) [m] of this box.
        fixture: Kind and parameters of the arm's fixture.
        recorded_path: Function that returns the recorded path when time jumps; None without a recording.
    """

    def __init__(self, server: viser.ViserServer, arm: ShownArm) -> None:
        robot = self._robot = arm.robot
        self._server, self.path = server, f"/{arm.name or 'arm'}"
        self.bodies = bodies_of(robot)
        start = posture(robot)
        self._own_low, self._own_high = extent(self.bodies, start)
        self._root = server.scene.add_frame(self.path, show_axes=False)
        if arm.name:
            server.scene.add_label(f"{self.path}/name", arm.name, anchor="top-center")
        self._looks, self._fingers = looks_of(robot), fingers_of(robot)
        self.drawn = BodyNodes(server, f"{self.path}/robot", self.bodies, self._looks, self._fingers)
        self._ghost: BodyNodes | None = None
        self._is_ghost_shown = False
        self.measured = Tail(server, f"{self.path}/measured", MEASURED)
        self.reference = Tail(server, f"{self.path}/reference", WANTED, 1.5)
        self._axes = PUBLISHED_AXES
        self._stand = stand_beside(self._own_low, self._own_high, self._axes)
        self.master = MasterNodes(server, f"{self.path}/master", self._stand)
        self._tails = self.measured, self.reference, self.master.tail
        self.world = WorldNodes(server, self.path, robot)
        self.jaw = JawNodes(server, self.path, has_fingers=bool(self._fingers) or robot.world_base is not None)
        self.fixture = Look()
        self._goal: viser.IcosphereHandle | None = None
        self.outline = OutlineNode(server, f"{self.path}/fixture", self._stand.quaternion)
        self._poses = self.drawn.move(start)
        self._begin: Array | None = None
        self._name, self._last = arm.name, 0.0
        self.recorded_path: Path | None = None
        self._side, self._count = 0.0, 0
        self.low, self.high = self._room()
        self._works: Array | None = None

    # -- places ----------------------------------------------------------------------------------

    def place(self, side: float) -> None:
        """Move arm and master to a position along the page's y axis [m]."""
        self._side = side
        self._root.position = (0.0, side, 0.0)

    def stand_beside(self, first: Robot) -> None:
        """Put the arm of a scene where it stands beside the first arm, whose base has the axes of the page.

        The scene draws the arm's own bodies. Cameras take the arm's position into account, but not its rotation.
        """
        self.drawn.show(is_shown=False)
        if self._robot.world_base is not None and first.world_base is not None:
            pose = product(inverse(pose_of(first.world_base)), pose_of(self._robot.world_base))
            self._side = float(pose[1])
            move(self._root, pose)

    def give_way(self, *, is_hidden: bool) -> None:
        """Hide the arm and all paths while a picture takes the place of the scene; the master stays."""
        self.drawn.show(is_shown=not is_hidden and self._robot.world_base is None)
        for tail in self._tails:
            tail.show(is_shown=not is_hidden)

    def room(self) -> tuple[Array, Array]:
        """Lowest and highest corner (3,) [m] of arm and master, in the axes of the page."""
        shift = np.array([0.0, self._side, 0.0])
        return self.low + shift, self.high + shift

    def _room(self) -> tuple[Array, Array]:
        vertices = np.concatenate([mesh_of(solid)[0] for solid in DEVICE] + [REST[None, :3]])
        points = vertices @ self._stand.axes.T + self._stand.origin
        points = np.concatenate((points, self._own_low[None], self._own_high[None]))
        return points.min(axis=0), points.max(axis=0)

    def work(self) -> Array:
        """Corners (16, 3) [m] of the boxes in which stylus and tip work, in the axes of the page.

        The tip's box contains all positions of the tip so far, the fixture, the object and the goals.
        """
        hand = self._stand.axes @ REST[:3] + self._stand.origin
        tip, room = self._start(), max(_WORK, 0.08 * self.bodies.size)
        low, high = (tip - room, tip + room) if self._works is None else self._works
        shift = np.array([0.0, self._side, 0.0])
        return np.concatenate((corners(hand - _GRIP, hand + _GRIP), corners(low, high))) + shift

    def _meet(self, view: ArmView) -> None:
        """Extend the boxes that :meth:`work` returns by the newest data."""
        tip, room, reach = self._start(), max(_WORK, 0.08 * self.bodies.size), _NEAR * self.bodies.size
        points = [self._poses[-1, :3]]
        if (box := box_of(view.state)) is not None:
            points += [box[0] - 0.5 * box[1], box[0] + 0.5 * box[1]]
        if self._goal is not None and self._goal.visible:
            points.append(np.asarray(self._goal.position))
        objects = [*self.world.points(), *(np.asarray(block.position) for block in self.jaw.blocks)]
        points += [np.clip(one, tip - reach, tip + reach) for one in objects]
        met = np.array(points)
        before = (tip - room, tip + room) if self._works is None else self._works
        self._works = np.array((np.minimum(before[0], met.min(axis=0)), np.maximum(before[1], met.max(axis=0))))

    def _start(self) -> Array:
        """First measured position (3,) [m] of the tip, in the axes of its base."""
        return self._poses[-1, :3].copy() if self._begin is None else self._begin

    def tip(self) -> Array:
        """Pose (7,) of the tip as it is drawn, in the axes of the page."""
        pose = self._poses[-1].copy()
        pose[1] += self._side
        return pose

    def begin(self) -> Array:
        """First measured position (3,) [m] of the tip, in the axes of the page."""
        return self._start() + np.array([0.0, self._side, 0.0])

    def turn_master(self, axes: Array) -> None:
        """Rotate the master so that stylus and tip move in the same direction on the page.

        Args:
            axes: Rotation (3, 3) from the master's base to the slave's axes.
        """
        if np.array_equal(axes, self._axes):
            return
        self._axes = axes
        self._stand = stand_beside(self._own_low, self._own_high, axes)
        self.master.stand(self._stand)
        self.outline.turn(self._stand.quaternion)

    # -- drawing ---------------------------------------------------------------------------------

    def draw(self, time: float, view: ArmView) -> None:
        """Draw the data of a time of the session [s]."""
        state = view.get(SLAVE_MEASURED_JS)
        if state is not None:
            joints = state[: self._robot.n]
            self._poses = self.drawn.move(joints)
            self.drawn.mark(self._at_limit(joints, view.state))
        self._draw_ghost(view)
        self._draw_paths(time, view)
        force = view.get(MASTER_MEASURED_CF)
        felt = self.master.draw(time, view.get(MASTER_MEASURED_CP), None if force is None else force[:3])
        self._draw_fixture(view, is_touched=felt > _TOUCH)
        push = view.get(SLAVE_MEASURED_CF)
        self.world.draw(self._poses[-1][:3], None if push is None else push[:3])
        self.jaw.draw(self._poses[-1], view)
        if self._fingers and self.jaw.opening is not None:
            self.drawn.grip(self.jaw.opening)
        self._draw_goal(view)
        if self._begin is not None:
            self._meet(view)

    def _draw_ghost(self, view: ArmView) -> None:
        """Draw the commanded posture at a third of the page's rate, which is sufficient for people."""
        reference = view.get(SLAVE_SETPOINT_JS)
        self._count = (self._count + 1) % 3
        if self._ghost is not None and reference is not None and self._is_ghost_shown and not self._count:
            self._ghost.move(reference)

    def _draw_paths(self, time: float, view: ArmView) -> None:
        if self.recorded_path is not None and is_jump(self._last, time):
            topics = (SLAVE_MEASURED_CP, SLAVE_SETPOINT_CP, MASTER_MEASURED_CP)
            for tail, topic in zip(self._tails, topics, strict=True):
                times, rows = self.recorded_path(topic, self._name, LENGTH)
                tail.fill(times, rows[:, :3])
        self._last = time
        measured = view.get(SLAVE_MEASURED_CP)
        if measured is not None and self._begin is None:
            self._begin = measured[:3].copy()
        reference = view.get(SLAVE_SETPOINT_CP)
        if reference is None:
            reference = view.get(SLAVE_SERVO_CP)
        self.measured.draw(time, None if measured is None else measured[:3])
        self.reference.draw(time, None if reference is None else reference[:3])

    def _draw_goal(self, view: ArmView) -> None:
        """Draw the goal of a task as a ball with the goal's width."""
        told = view.get(TASK_STATE)
        is_there = told is not None and told[0] > 0.0
        if self._goal is None and is_there:
            self._goal = self._server.scene.add_icosphere(
                f"{self.path}/goal", 0.5, TARGET, subdivisions=2, opacity=0.5, cast_shadow=False
            )
            self._server.scene.add_label(f"{self.path}/goal/name", "goal")  # the goal may be inside the tool, or small
        if self._goal is None:
            return
        self._goal.visible = is_there
        if told is not None and is_there:
            self._goal.position = told[_GOAL : _GOAL + 3]
            self._goal.scale = max(float(told[_GOAL + 3]), _LEAST_GOAL)

    def _draw_fixture(self, view: ArmView, *, is_touched: bool) -> None:
        """Draw the reported fixture around the slave, and its image around the hand."""
        box = box_of(view.state)
        hand, command = view.get(MASTER_MEASURED_CP), view.get(SLAVE_SERVO_CP)
        gain = view.state.get("gain", 0.0)
        if box is None or gain <= 0.0:
            self.outline.hide()
            self.master.outline.hide()
            return
        center, size = box
        along = np.abs(self._axes.T) @ size  # the master's axes are the slave's axes in another order and sign
        look, unit = self.fixture, unit_outline(self.fixture)
        scale = scale_of(unit, along, gain)
        self.outline.draw(look, center, scale, is_touched=is_touched)
        if hand is not None and command is not None:
            around = hand[:3] + self._axes.T @ (center - command[:3]) / gain
            self.master.outline.draw(look, around, scale / gain, is_touched=is_touched)

    def _at_limit(self, joints: Array, state: dict[str, float]) -> frozenset[int]:
        """Joints that are at their limits, or that the session reports as the limit.

        A joint whose home position is at its limit is included only if the session reports it as the limit.
        """
        robot = self._robot
        room = _AT * (robot.upper - robot.lower)
        is_at = (joints <= robot.lower + room) | (joints >= robot.upper - room)
        found = set(np.flatnonzero(is_at & (np.abs(joints - robot.home) > room)).tolist())
        told = state.get("limited_joint", -1.0)  # NaN in recordings of early versions
        if state.get("limit") == Limit.JOINT and 0 <= told < self._robot.n:
            found.add(int(told))
        return frozenset(found)

    # -- what is shown ---------------------------------------------------------------------------

    def show(self, what: str, *, is_shown: bool) -> None:
        """Show one of :data:`SHOWN`, or hide it; ghost and reach are sent when they are first shown."""
        scene, place = self._server.scene, f"{self.path}/{what}"
        if what == "axes":
            self.drawn.show_axes(is_shown=is_shown)
            self.master.show_axes(is_shown=is_shown)
        elif what == "paths":
            for tail in self._tails:
                tail.show(is_shown=is_shown)
        elif is_shown and scene.get_handle_by_name(place) is None:
            if what == "ghost":
                scene.add_frame(place, show_axes=False)
                self._ghost = BodyNodes(self._server, place, self.bodies, self._looks, self._fingers, is_ghost=True)
                self._ghost.move(posture(self._robot))
            else:
                points, _ = sample_workspace(self._robot, _REACHED, np.random.default_rng(0))
                size = _POINT * self.bodies.size
                scene.add_point_cloud(place, points, colors=ROLES["leg"], point_size=size, point_shape="circle")
        self._is_ghost_shown = is_shown if what == "ghost" else self._is_ghost_shown
        if (node := scene.get_handle_by_name(place)) is not None:
            node.visible = is_shown

    def set_background(self, color: Color) -> None:
        """Set the colour into which the paths fade."""
        for tail in self._tails:
            tail.set_background(color)


def posture(robot: Robot) -> Array:
    """Start (n,) [rad, m] of the robot in a session; the robot's home if the start cannot be computed."""
    with suppress(TeleopError):
        return robot.start
    return robot.home
