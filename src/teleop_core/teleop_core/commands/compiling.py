"""``teleop compile``: kernels of the built-in parts, compiled before a session needs them."""

import argparse
from collections.abc import Iterator, Sequence
from os import sched_getaffinity
from pathlib import Path

from teleop_core.commands.arguments import command

_EPILOG = """\
a session compiles what it needs and is not there yet; compiled before, it starts at once:
  teleop compile                                        what the scenarios need
  teleop compile --all                                  every robot, law, plant and shape too
"""
_FIRST = "coarse_box"
Job = tuple[str, str, str]
"""Scenario, setting or nothing, stage or nothing for the whole session."""


def add(commands: argparse._SubParsersAction) -> None:  # type: ignore[type-arg]
    """Add the command's parser."""
    text = "compile the kernels of built-in parts now, on all processors"
    parser = command(commands, "compile", _run, text, _EPILOG)
    parser.add_argument("--all", action="store_true", help="also those that no scenario needs")


def _run(arguments: argparse.Namespace) -> int:
    from concurrent.futures import ProcessPoolExecutor, as_completed
    from multiprocessing import get_context

    from teleop_core.commands.progress import shown_progress
    from teleop_core.kernels.store import prune

    phases = list(_phases(is_all=arguments.all))
    total, done, compiled = sum(map(len, phases)), 0, 0
    workers = ProcessPoolExecutor(len(sched_getaffinity(0)), get_context("spawn"))
    with shown_progress("kernels") as progress, workers:
        for jobs in phases:
            waiting = [workers.submit(_compile, job, arguments.all) for job in jobs]
            for made in as_completed(waiting):
                compiled, done = compiled + made.result(), done + 1
                progress(done, total)
    prune()
    print(f"{compiled} kernels compiled" if compiled else "all kernels are there")
    return 0


def _phases(*, is_all: bool) -> Iterator[Sequence[Job]]:
    """Jobs to be done side by side, one group after the other: later ones find what is there."""
    from teleop_core.chain.fixtures import FIXTURES
    from teleop_core.graph.graph import BUILT_IN
    from teleop_core.graph.layers import list_scenarios
    from teleop_core.robots import ROBOTS
    from teleop_core.slave.controllers import CONTROLLERS
    from teleop_core.slave.plants import PLANTS

    yield [(_FIRST, "", stage) for stage in BUILT_IN]
    yield [(_FIRST, "", "")]
    yield [(scenario, "", "") for scenario in list_scenarios() if scenario != _FIRST]
    if is_all:
        for key, parts in (
            ("robot", ROBOTS),
            ("controller", CONTROLLERS),
            ("plant", PLANTS),
            ("fixture", FIXTURES),
        ):
            yield [(_FIRST, f"{key}={name}", "") for name in parts]


def _compile(job: Job, is_replayed: bool) -> int:
    """Number of kernels that were compiled to run a stage or a short session."""
    import tempfile

    from teleop_core.graph.signals import DT
    from teleop_core.graph.stage import STAGES
    from teleop_core.kernels.progress import compiled_count
    from teleop_core.session import api

    scenario, setting, stage = job
    before = compiled_count()
    texts = [setting] if setting else []
    configuration = api.configuration(scenario, texts=["teleop.duration=0.01", *texts])
    if stage:
        runner = STAGES.find(stage).run(configuration.groups[stage], DT)
        runner.load()
        if (motion := getattr(runner, "motion", None)) is not None:
            motion.load()  # commands, which a live slave takes
        return compiled_count() - before
    with tempfile.TemporaryDirectory() as folder:
        recording = Path(folder) / "recording"
        api.run(configuration, out=recording)
        if is_replayed:
            api.replay(recording, out=Path(folder) / "replay")
    return compiled_count() - before
