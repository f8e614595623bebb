"""Checks: requests of a study that its sessions cannot fulfil, reported before the first session runs."""

from collections.abc import Sequence

import numpy as np

from teleop_core.base.errors import ParameterError
from teleop_core.evaluation.objects import ObjectMetric
from teleop_core.evaluation.registry import METRICS
from teleop_core.robots import load_robot_set
from teleop_core.session.configuration import Configuration
from teleop_core.slave.world.contents import WorldParameters

_NEAR = 0.02
"""An object is reachable if its distance from the tip can be below this [m]. Other orientations of the tool reach
farther."""


def insist_on_scores(made: Configuration, metrics: Sequence[str]) -> None:
    """Check that the sessions produce the scores.

    Raises:
        ParameterError: A score needs topics that no stage writes, or an object that does not exist.
    """
    written = {topic.name for topic in made.graph.topics}
    places = {metric.partition(".")[0]: metric for metric in metrics}
    for metric in map(METRICS.find, METRICS):
        if (asked := places.get(metric.place())) is None:
            continue
        reads = [topic.name for topic in metric.topics]
        if reads and not written.intersection(reads):
            raise ParameterError(
                "metrics", asked, f"metrics of topics of the session; no stage writes {' or '.join(reads)}"
            )
        world = made.value("world")
        if issubclass(metric, ObjectMetric) and not (world and isinstance(world.kind.parameters, metric.kind)):
            raise ParameterError(
                "metrics", asked, f"metrics of an object of the session, which has no {metric.place()}"
            )


def insist_on_reach(made: Configuration) -> None:
    """Check that the slave can touch the object, if the session gives a position for it.

    Raises:
        ParameterError: The tip cannot come near the object.
    """
    for arm in made.graph.namespaces:
        world = made.value("world", arm)
        if not isinstance(world, WorldParameters) or world.kind.kind == "empty" or not world.place:
            continue
        robot = load_robot_set(str(made.value("robot", arm)), made.value("geometry", arm) or ())
        pose = robot.fk(robot.start)
        center = world.center(pose)
        pose[:3, 3] = center
        nearest = robot.fk(robot.ik(pose, robot.start).q)
        if (gap := world.distance(world.tool(nearest), center)) > _NEAR:
            text = f"within reach of the slave, whose tip comes no nearer than {gap:.3g} m"
            raise ParameterError("world.place", tuple(np.round(world.place, 4).tolist()), text)
