"""``teleop compile``: compiles the kernels of the built-in parts before a session needs them."""

from collections.abc import Iterator, Sequence
from os import sched_getaffinity
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

if TYPE_CHECKING:
    from teleop_core.session.configuration import Configuration

_FIRST = "coarse_box"
Job = tuple[str, str, str]
"""Scenario, setting (may be empty), and stage; an empty stage means the whole session."""
_MESH = "OFF\n4 4 6\n0 0 0\n90 90 0\n90 0 90\n0 90 90\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n"
"""A closed surface of four triangles [mm], for parts that need a file."""


def compile_(*, all_: Annotated[bool, Parameter(name="--all")] = False) -> None:
    """Compile the kernels of built-in parts now, on all processors.

    A session compiles what it needs and is not there yet; compiled before, it starts at once:

        teleop compile        # what the scenarios need
        teleop compile --all  # every robot, law, plant and shape too

    Args:
        all_: Also compile kernels that no scenario needs.
    """
    from concurrent.futures import as_completed

    from teleop_core.base.workers import workers
    from teleop_core.commands.progress import shown_progress
    from teleop_core.kernels.store import prune

    phases = list(phases_of(is_all=all_))
    total, done, compiled = sum(map(len, phases)), 0, 0
    with shown_progress("kernels") as progress, workers(len(sched_getaffinity(0))) as pool:
        for jobs in phases:
            waiting = [pool.submit(_compile, job, all_) for job in jobs]
            for made in as_completed(waiting):
                compiled, done = compiled + made.result(), done + 1
                progress(done, total)
    prune()
    print(f"{compiled} kernels compiled" if compiled else "all kernels are there")


def phases_of(*, is_all: bool) -> Iterator[Sequence[Job]]:
    """Groups of jobs. Jobs of one group run in parallel; later groups reuse the kernels of earlier groups."""
    from importlib.util import find_spec

    from teleop_core.graph.graph import BUILT_IN
    from teleop_core.graph.layers import list_scenarios
    from teleop_core.robots import ROBOTS
    from teleop_core.shapes import SHAPES
    from teleop_core.slave.controllers import CONTROLLERS
    from teleop_core.slave.plants import PLANTS

    yield [(_FIRST, "", stage) for stage in BUILT_IN]
    yield [(_FIRST, "", "")]
    yield [(scenario, "", "") for scenario in list_scenarios() if scenario != _FIRST]
    if is_all:
        named = [name for name in SHAPES if find_spec("trimesh") or not _reads_a_file(name)]
        shapes = {SHAPES.find(name).distance: name for name in named}.values()  # one shape per kernel
        for key, parts in (("robot", ROBOTS), ("controller", CONTROLLERS), ("plant", PLANTS), ("fixture", shapes)):
            yield [(_FIRST, f"{key}={name}", "") for name in parts]


def _reads_a_file(shape: str) -> bool:
    from teleop_core.shapes import SHAPES

    return hasattr(SHAPES.find(shape).parameters, "file")


def configured_job(job: Job, folder: Path) -> "Configuration":
    """Configuration of a short session that needs a job's kernels.

    Args:
        job: See :data:`Job`.
        folder: Folder with a file for parts that need one.
    """
    from teleop_core.session import api

    scenario, setting, _ = job
    key, _, name = setting.partition("=")
    texts = [setting] if setting else []
    if key == "fixture" and _reads_a_file(name):
        mesh = folder / "mesh.off"
        mesh.write_text(_MESH, encoding="ascii")
        texts.append(f"fixture.{name}.file={mesh}")
    if setting == "fixture=hole":  # a hole whose middle is not in the plate
        texts.append("fixture.keep_out=true")
    return api.configuration(scenario, texts=["teleop.duration=0.01", *texts])


def _compile(job: Job, is_replayed: bool) -> int:
    """Number of kernels that were compiled to run a stage or a short session."""
    import tempfile

    from teleop_core.graph.signals import DT
    from teleop_core.graph.stage import STAGES
    from teleop_core.kernels.progress import compiled_count
    from teleop_core.session import api

    before, stage = compiled_count(), job[-1]
    with tempfile.TemporaryDirectory() as folder:
        configuration = configured_job(job, Path(folder))
        if stage:
            runner = STAGES.find(stage).run(configuration.groups[stage], DT)
            runner.load()
            if (motion := getattr(runner, "motion", None)) is not None:
                motion.load()  # commands that a live slave accepts
            return compiled_count() - before
        recording = Path(folder) / "recording"
        api.run(configuration, out=recording)
        if is_replayed:
            api.replay(recording, out=Path(folder) / "replay")
    return compiled_count() - before
