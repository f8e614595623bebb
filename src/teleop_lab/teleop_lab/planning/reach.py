"""Reach: the share of a hand's motion that a slave can follow, and the settings with which this share is largest."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from teleop_core.bags import arms, reader
from teleop_core.base import ParameterError, RecordingError, UnknownNameError
from teleop_core.coupling.mapping.gains import MotionScalingParameters
from teleop_core.coupling.mapping.inverse_kinematics import InverseKinematicsParameters
from teleop_core.graph import Layer, config_folder
from teleop_core.graph.layers import list_scenarios, load_file, parse_setting, scenario_file, setting
from teleop_core.session import api, configuration, master_bag, recording, runner
from teleop_core.slave.parameters import SlaveParameters
from teleop_lab.planning.aim import Aim
from teleop_lab.planning.asked import AskedPath, asked_path
from teleop_lab.planning.placement import Placement
from teleop_lab.planning.reach_result import Followed, Reach
from teleop_lab.planning.search import Search
from teleop_lab.planning.walk import Walker

GOAL = 0.99
"""Default share of the time in which the slave must follow."""
Progress = Callable[[int, int], None]
Setting = float | str | bool | Sequence[float] | Sequence[str]
_WHOLE = 150_000  # largest number of samples of the whole path
_EXCERPT = 6_000  # largest number of samples of the excerpt that the search uses
_EXCERPT_RATE = 20.0  # Hz
# Usual number of walks of a search; the progress bar needs it.
_USUAL_WALKS = 500
# The short excerpt is easier to follow than the whole path, so the search raises its goal up to this many times.
_ATTEMPTS = 3


def reach(
    source: recording.Recording | Path | str,
    *,
    robot: str | None = None,
    geometry: Iterable[str] = (),
    share: float = GOAL,
    arm: str = "",
    keeps_axes: bool = False,
    progress: Progress = runner.silent,
    files: Iterable[Path | str] = (),
    settings: Mapping[str, Setting] | None = None,
    texts: Iterable[str] = (),
) -> Reach:
    """Find the share of a hand's motion that a slave can follow, and the settings with which this share is largest.

    Args:
        source: A recording, its path, or the name of a scenario, which is run first. The search starts from the
            configuration in the recording. A foreign recording, in any file format that replay reads, contains no
            configuration; then the search starts from the default configuration.
        robot: Robot that replaces the slave of the configuration; the start is then the default start of this robot.
        geometry: Lengths and angles of the slave [m, rad] as ``symbol=value``.
        share: Share of the time in which the slave must follow, above 0 and at most 1.
        arm: Namespace of the arm; empty for the default arm.
        keeps_axes: Whether the map of axes from hand to slave must not change, for example because a camera looks at
            the slave from a fixed side.
        progress: Called with the progress.
        files: ROS 2 parameter files whose values override the configuration.
        settings: Parameters that override the files.
        texts: Parameters as ``key=value``, which override the settings.

    Returns:
        Followed shares, causes of the rest, and proposed settings.

    Raises:
        TeleopError: The recording or scenario is missing or contains no pose of a master, or a parameter is wrong. The
            message names the wrong value.
    """
    if not 0.0 < share <= 1.0:
        raise ParameterError("share", share, "above 0 and at most 1")
    changes = _changes(robot, geometry, files, settings or {}, texts)
    made, bag = _configured(source, changes)
    path = asked_path(arms.of_arm(bag, arm))
    return _reach(path, made, share, arm, progress, keeps_axes=keeps_axes)


def _changes(
    robot: str | None,
    geometry: Iterable[str],
    files: Iterable[Path | str],
    settings: Mapping[str, Setting],
    texts: Iterable[str],
) -> list[Layer]:
    layers = []
    if robot is not None:
        named = {"robot": robot, "geometry": list(geometry), "slave.start": []}
        layers = [setting(name, value) for name, value in named.items()]
    layers += [load_file(Path(file)) for file in files]
    layers += [setting(name, value) for name, value in settings.items()]
    return layers + [parse_setting(text) for text in texts]


def _configured(
    source: recording.Recording | Path | str, changes: list[Layer]
) -> tuple[configuration.Configuration, reader.Bag]:
    """Return the configuration with the changes, and the recording. A scenario is run first to make its recording."""
    if isinstance(source, str) and not Path(source).exists():
        if Path(source).name != source or Path(source).suffix:
            reason = "does not exist; give a recording, or one of `teleop scenarios`"
            raise RecordingError(source, reason)
        if source not in list_scenarios():
            raise UnknownNameError("recording or scenario", source, list_scenarios())
        made = _of_scenario(source, changes)
        return made, api.run(made).bag
    bag = master_bag.as_master_bag(source.bag if isinstance(source, recording.Recording) else source)
    layer, scenario = runner.recorded_configuration(bag)
    layers = configuration.with_changes(layer, changes)
    return configuration.Configuration.from_layers(layers, scenario), bag


def _of_scenario(name: str, changes: list[Layer]) -> configuration.Configuration:
    """Configuration of a scenario in which the hand does not feel the slave's limits."""
    files = [config_folder() / "teleop.yaml", scenario_file(name)]
    free = setting("motion_scaling.reach_force.is_on", False)
    return configuration.Configuration.from_layers([*map(load_file, files), *changes, free], name)


def _reach(
    path: AskedPath, made: configuration.Configuration, goal: float, arm: str, progress: Progress, *, keeps_axes: bool
) -> Reach:
    scaling, solving = made.of(MotionScalingParameters, arm), made.of(InverseKinematicsParameters, arm)
    whole = Walker(path.limited(_WHOLE), scaling, solving)
    start = made.of(SlaveParameters, arm).start_of(whole.robot)
    given = Placement.of(scaling, solving, tuple(start))
    done = 0

    def tell() -> None:
        nonlocal done
        done += 1
        progress(min(done, _USUAL_WALKS - 1), _USUAL_WALKS)

    aim = Aim(whole.robot, path.stylus, given)
    as_given = _followed(whole, given, given, aim)
    proposed = as_given
    if as_given.share < goal:
        excerpt = Walker(path.excerpt(_EXCERPT_RATE, _EXCERPT), scaling, solving)
        search = Search(excerpt, given, aim, tell, keeps_axes=keeps_axes)
        proposed = _proposed(whole, search, as_given, goal, aim)
    progress(_USUAL_WALKS, _USUAL_WALKS)
    return Reach(whole.path, whole.robot, goal, as_given, proposed, arm)


def _followed(walker: Walker, placement: Placement, given: Placement, aim: Aim) -> Followed:
    full = replace(placement, coarse_gain=given.coarse_gain, fine_gain=given.fine_gain)
    session = walker.walk(placement)
    return Followed(
        placement=placement,
        session=session,
        in_place=walker.walk(placement, is_cut=False, is_fast=True),
        at_given_gain=session.share if full == placement else walker.share(full),
        misfit=aim.misfit(placement),
    )


def _proposed(whole: Walker, search: Search, given: Followed, goal: float, aim: Aim) -> Followed:
    """Return the best placement found; the goal on the excerpt is raised until the whole path reaches `goal`."""
    best, wanted = (given.share, given.placement), goal
    for _ in range(_ATTEMPTS):
        placement = search.best(min(wanted, 1.0))[1]
        share = whole.share(placement)
        best = max(best, (share, placement), key=lambda found: found[0])
        if share >= goal or wanted >= 1.0:
            break
        wanted += 1.5 * (goal - share)
    return _followed(whole, best[1], given.placement, aim)
