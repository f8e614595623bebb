"""Scene: the arms of a session on the page, with their masters, paths, fixtures and forces."""

from collections.abc import Iterable

import numpy as np
import viser

from teleop_console.arm_nodes import ArmNodes, Path
from teleop_console.cameras import ASPECT, FIELD, Camera, around, corners, from_tool, microscope
from teleop_console.fixture_outlines import Look
from teleop_console.link import Parameters, Setting, ShownArm, View
from teleop_console.look import DARK, GRID, GRID_DARK, LIGHT, TARGET
from teleop_console.stand import PUBLISHED_AXES
from teleop_console.surrounding_nodes import SurroundingNodes
from teleop_core.base.errors import TeleopError
from teleop_core.hand.operators.rest import REST_POSITION
from teleop_core.kernels.axes import axis_map
from teleop_core.kernels.geometry import Array

_POINTS = {"tour": "tour.points", "points": "points"}
"""Parameter with the points, by the kind of an operator that moves to points."""
_PIECES = 6  # number of pieces of a floor line, each with a linear fade


def targets_of(parameters: Parameters, arm: str) -> Array:
    """Points (N, 3) [m] in master_base to which the operator of an arm moves; empty for operators without points.

    Args:
        parameters: Result of :meth:`~teleop_console.link.SessionLink.parameters`.
        arm: Namespace of the arm.
    """
    node = f"{arm}/operator" if arm else "operator"
    values = {name: info.value for (owner, name), info in parameters.items() if owner == node}
    points = values.get(_POINTS.get(str(values.get("kind")), ""))
    center = np.array(values.get("center", (0.0, 0.0, 0.0)), dtype=np.float64)
    if not isinstance(points, tuple) or not points or len(points) % 3:
        return np.zeros((0, 3))
    return np.asarray(REST_POSITION + center + np.reshape(np.array(points, np.float64), (-1, 3)))


def floor_lines(radius: float, cell: float) -> tuple[Array, Array]:
    """Grid lines of a floor that fade towards the rim; every fifth line is stronger.

    Lines replace a grid that a shader draws: with software rendering, such a grid takes a quarter of the drawing time.

    Args:
        radius: Radius at which the lines end [m].
        cell: Distance between two neighbouring lines [m].

    Returns:
        Segments (N, 2, 3) [m] about the origin, and the opacity of both ends of each segment (N, 2), 0 to 1.
    """
    count = round(radius / cell)
    joints = np.linspace(-count, count, _PIECES + 1)
    lines = np.arange(-count, count + 1)
    along = np.tile(np.stack((joints[:-1], joints[1:]), axis=1), (len(lines), 1))
    across = np.repeat(lines, _PIECES)
    ends = np.stack((along, np.stack((across, across), axis=1)), axis=-1)
    weight = np.where(across % 5 == 0, 0.8, 0.3)[:, None]
    strength = weight * np.clip(1.0 - np.linalg.norm(ends, axis=-1) / count, 0.0, 1.0)
    is_seen = strength.any(axis=1)
    points = np.insert(cell * ends[is_seen], 2, 0.0, axis=-1)
    return np.concatenate((points, points[..., [1, 0, 2]])), np.tile(strength[is_seen], (2, 1))


class Scene:
    """Three-dimensional scene of a session; the axes of the page are those of the first arm's base, z up.

    Args:
        server: The page.
        arms: Arms of the session, at least one.
    """

    def __init__(self, server: viser.ViserServer, arms: Iterable[ShownArm]) -> None:
        self._server = server
        self.arms: dict[str, ArmNodes] = {}
        side = 0.0
        # With software rendering, shadows and reflections would take half of the drawing time.
        server.scene.configure_default_lights(cast_shadow=False)
        server.scene.configure_environment_map(None)
        server.scene.add_light_hemisphere("/light", intensity=1.5)
        with server.atomic():
            each = list(arms)
            self._surroundings = SurroundingNodes(server, each[0].robot)
            for arm in each:
                nodes = ArmNodes(server, arm)
                low, high = nodes.low, nodes.high
                if self.arms:  # to the right of the previous arm
                    side -= float(high[1])
                if arm.robot.world_base is None:
                    nodes.place(side)
                else:
                    nodes.stand_beside(each[0].robot)
                side += float(low[1]) - 0.1 * nodes.bodies.size
                self.arms[arm.name] = nodes
            self._ground()
            self.set_dark(is_dark=False)
            self._begin()

    # -- drawing ---------------------------------------------------------------------------------

    def draw(self, view: View) -> None:
        """Draw the newest data; only changes are sent."""
        with self._server.atomic():
            for name, nodes in self.arms.items():
                if (seen := view.arms.get(name)) is not None:
                    nodes.draw(view.time, seen)
            if (seen := view.arms.get(next(iter(self.arms)))) is not None:
                self._surroundings.draw(seen)

    def retune(self, parameters: Parameters) -> None:
        """Apply the session's parameters that change the picture: axes, fixture, targets and object.

        Args:
            parameters: Result of :meth:`~teleop_console.link.SessionLink.parameters`. Missing parameters change
                nothing.
        """
        with self._server.atomic():
            for name, nodes in self.arms.items():
                node = f"{name}/motion_scaling" if name else "motion_scaling"
                if (axes := parameters.get((node, "axes"))) is not None:
                    nodes.turn_master(_map(axes.value))
                if (kind := parameters.get((node, "fixture.kind"))) is not None:
                    nodes.fixture = _look(parameters, node, str(kind.value))
                self._show_targets(nodes, targets_of(parameters, name))
                plant = f"{name}/slave_sim" if name else "slave_sim"
                nodes.world.retune(_values_below(parameters, plant, "world."))
                jaw = f"{name}/jaw_sim" if name else "jaw_sim"
                upper = parameters.get((jaw.removesuffix("_sim"), "upper"))
                nodes.jaw.retune(_values_below(parameters, jaw, ""), None if upper is None else upper.value)

    def _show_targets(self, nodes: ArmNodes, points: Array) -> None:
        """Show the points of a task in the hand's space, as balls of 2 mm."""
        if len(points):
            self._server.scene.add_point_cloud(
                f"{nodes.master.path}/targets", points, colors=TARGET, point_size=0.002, point_shape="circle"
            )

    def remember(self, path: Path) -> None:
        """Take paths from a recording when time jumps; without a recording, paths then start anew."""
        for nodes in self.arms.values():
            nodes.recorded_path = path

    # -- what is shown ---------------------------------------------------------------------------

    def show(self, what: str, *, is_shown: bool) -> None:
        """Show one of :data:`~teleop_console.arm_nodes.SHOWN` of all arms, or hide it."""
        with self._server.atomic():
            for nodes in self.arms.values():
                nodes.show(what, is_shown=is_shown)

    def give_way(self, *, is_hidden: bool) -> None:
        """Hide all but the masters while the picture of a camera takes the place of the scene."""
        with self._server.atomic():
            self._floor.visible = not is_hidden
            self._surroundings.show(is_shown=not is_hidden)
            for nodes in self.arms.values():
                nodes.give_way(is_hidden=is_hidden)

    def set_dark(self, *, is_dark: bool) -> None:
        """Set the colours for a dark or a light page."""
        ground, line = (DARK, GRID_DARK) if is_dark else (LIGHT, GRID)
        shade = np.array(ground) + self._strength[:, :, None] * (np.array(line) - np.array(ground))
        self._floor.colors = shade.astype(np.uint8)
        for nodes in self.arms.values():
            nodes.set_background(ground)

    # -- cameras ---------------------------------------------------------------------------------

    def work(self, aspect: float = ASPECT) -> Camera:
        """Camera whose picture contains all tips and styli with the space around them."""
        return around(np.concatenate([nodes.work() for nodes in self.arms.values()]), aspect)

    def whole(self, aspect: float = ASPECT) -> Camera:
        """Camera whose picture contains all arms and masters; ``aspect`` is width divided by height."""
        rooms = [corners(*nodes.room()) for nodes in self.arms.values()]
        return around(np.concatenate(rooms), aspect)

    def tool(self, arm: str = "") -> Camera:
        """Camera on the tool of an arm at its present pose; the first arm is used if the given arm does not exist."""
        nodes = self._arm(arm)
        return from_tool(nodes.tip(), nodes.bodies.size)

    def microscope(self, arm: str = "") -> Camera:
        """Fixed camera above the start of an arm's tip; the first arm is used if the given arm does not exist."""
        nodes = self._arm(arm)
        return microscope(nodes.begin(), nodes.bodies.size)

    def _arm(self, name: str) -> ArmNodes:
        return self.arms.get(name) or next(iter(self.arms.values()))

    @property
    def masters(self) -> dict[str, str]:
        """Path of the node in master_base of each arm, by namespace, for a Stylus."""
        return {name: nodes.master.path for name, nodes in self.arms.items()}

    # -- the begin -------------------------------------------------------------------------------

    def _ground(self) -> None:
        boxes = [nodes.room() for nodes in self.arms.values()]
        low = np.min([low for low, _ in boxes], axis=0)
        high = np.max([high for _, high in boxes], axis=0)
        wide = 2.5 * float((high - low)[:2].max())
        cell = 10.0 ** np.floor(np.log10(wide / 5.0))
        middle = 0.5 * (low + high)
        points, self._strength = floor_lines(0.5 * wide, cell)
        place = (middle[0], middle[1], low[2] - 1e-3)
        self._floor = self._server.scene.add_line_segments(
            "/ground", points.astype(np.float32), GRID, thickness=2.0, thickness_units="screen", position=place
        )

    def _begin(self) -> None:
        first, camera = self.work(), self._server.initial_camera
        camera.fov, camera.up = FIELD, first.up
        camera.position, camera.look_at = first.position, first.look_at


def _look(parameters: Parameters, node: str, kind: str) -> Look:
    """Kind and parameters of a node's fixture."""
    values = _values_below(parameters, node, f"fixture.{kind}.")
    if (place := parameters.get((node, "fixture.place"))) is not None:
        values["place"] = place.value
    return Look(kind, tuple(values.items()))


def _values_below(parameters: Parameters, node: str, start: str) -> dict[str, Setting]:
    """Values of a node's parameters whose names begin with ``start``, by the rest of the name."""
    return {
        name.removeprefix(start): info.value
        for (owner, name), info in parameters.items()
        if owner == node and name.startswith(start)
    }


def _map(axes: object) -> Array:
    """Rotation (3, 3) for the value of an axes parameter; the published rotation if the value is not valid."""
    try:
        return axis_map("axes", tuple(axes))  # type: ignore[arg-type]
    except (TeleopError, TypeError, ValueError):
        return PUBLISHED_AXES
