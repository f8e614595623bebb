"""``teleop compile``: compiles the kernels of the built-in parts before a session needs them."""

from collections.abc import Iterable, Iterator, Sequence
from os import sched_getaffinity
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from teleop_core.session.configuration import Configuration


class Job(NamedTuple):
    """Kernels to compile: those of a stage, or those of a short session."""

    scenario: str = "coarse_box"
    texts: tuple[str, ...] = ()
    stage: str = ""


_MESH = "OFF\n4 4 6\n0 0 0\n90 90 0\n90 0 90\n0 90 90\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n"
"""A closed surface of four triangles [mm], for parts that need a file."""
_AXES = "0 0 1", "0 1 0"
_PAIR, _MESSAGES = "pair", "messages"
"""Stage of a job for a server and its simulated arm as one object."""


def compile_(*, scenarios: bool = False) -> None:
    """Compile all kernels now, on all processors.

    A session compiles what it needs and is not there yet; compiled before, it starts at once:

        teleop compile --scenarios  # what "make setup" compiles
        teleop compile  # everything of teleop_core, for every arm and graph

    Args:
        scenarios: Compile only what the built-in scenarios need, also with an arm from a URDF file.
    """
    from concurrent.futures import as_completed

    from teleop_core.base.workers import workers
    from teleop_core.commands.progress import shown_progress
    from teleop_core.kernels.store import prune

    phases = list(phases_of())
    if scenarios:
        phases.pop()
    total, done, compiled = sum(map(len, phases)), 0, 0
    with shown_progress("kernels") as progress, workers(len(sched_getaffinity(0)), _collect_rarely) as pool:
        for jobs in phases:
            waiting = [pool.submit(_compile, job) for job in jobs]
            for made in as_completed(waiting):
                compiled, done = compiled + made.result(), done + 1
                progress(done, total)
    prune()
    print(f"{compiled} kernels compiled" if compiled else "all kernels are there")


def phases_of() -> Iterator[Sequence[Job]]:
    """Groups of jobs. Jobs of one group run in parallel; later groups reuse the kernels of earlier groups.

    The last group is what no built-in scenario needs.
    """
    from teleop_core.graph.graph import BUILT_IN
    from teleop_core.graph.layers import list_scenarios

    yield [*(Job(stage=stage) for stage in reversed(BUILT_IN)), Job(stage=_MESSAGES)]
    seven, six, puma = (Job(texts=(f"robot={name}",)) for name in ("arm7.urdf", "arm6.urdf", "puma560"))
    yield [seven, *map(Job, list_scenarios()), six, puma]  # arms that share kernels follow one another
    yield [Job(stage=_PAIR), *(Job(texts=texts) for texts in _parts())]


def _collect_rarely() -> None:
    """Collect garbage a hundred times less often: of the processor time of compilation, collections take a seventh."""
    import gc

    gc.set_threshold(100_000)


def _parts() -> Iterator[tuple[str, ...]]:
    """Settings that need kernels of their own, the longest work first."""
    from importlib.util import find_spec

    from teleop_core.coupling.architectures import ARCHITECTURES
    from teleop_core.coupling.filters import TREMOR_FILTERS
    from teleop_core.coupling.network import NETWORKS
    from teleop_core.coupling.passivity import PASSIVITIES
    from teleop_core.hand.tasks import TASKS
    from teleop_core.robots import ROBOTS
    from teleop_core.robots.parts import SCENES
    from teleop_core.shapes import SHAPES
    from teleop_core.slave.controllers import CONTROLLERS
    from teleop_core.slave.plants import PLANTS

    named = [name for name in SHAPES if find_spec("trimesh") or not _reads_a_file(name)]
    shapes = {SHAPES.find(name).distance: name for name in named}.values()  # one shape per kernel
    kinds: dict[str, Iterable[str]]
    plants = [name for name in PLANTS if name not in PLANTS.elsewhere]
    kinds = {"robot": ROBOTS, "controller": CONTROLLERS, "plant": plants, "fixture": shapes}
    for key, parts in kinds.items():
        yield from ((f"{key}={name}",) for name in parts)
    stages: tuple[tuple[str, str, Iterable[str]], ...] = (
        ("network,impedance,passivity", "reflection.architecture", ARCHITECTURES),
        ("network,passivity", "reflection.passivity", PASSIVITIES),
        ("network", "network.there.kind", NETWORKS),
        ("tremor_filter", "tremor_filter.kind", TREMOR_FILTERS),
        ("display,task", "task.kind", TASKS),
    )
    for used, key, names in stages:
        yield from ((f"teleop.stages=[{used}]", f"{key}={name}") for name in names)
    yield ("teleop.stages=[remote_centre]",)
    if SCENES.names():
        yield ("robot=cubes.xml", "teleop.stages=[jaw_command,jaw]")


def _reads_a_file(shape: str) -> bool:
    from teleop_core.shapes import SHAPES

    return hasattr(SHAPES.find(shape).parameters, "file")


def _urdf(joints: int) -> str:
    """Arm whose axes turn about z and y in turn; those of the last three joints meet."""
    lines = ['<robot name="arm"><link name="l0"/>']
    for i in range(joints):
        place, axis = 0.3 if i < joints - 2 else 0.0, _AXES[i % 2]
        lines.append(
            f'<link name="l{i + 1}"/><joint name="j{i + 1}" type="revolute"><parent link="l{i}"/>'
            f'<child link="l{i + 1}"/><origin xyz="0 0 {place}"/><axis xyz="{axis}"/>'
            '<limit effort="100" velocity="2" lower="-2.8" upper="2.8"/></joint>'
        )
    return "\n".join((*lines, "</robot>"))


def configured_job(job: Job, folder: Path) -> "Configuration":
    """Configuration of a short session that needs a job's kernels.

    Args:
        job: The job.
        folder: Folder with a file for parts that need one.
    """
    from teleop_core.session import api

    texts = list(job.texts)
    for text in job.texts:
        key, _, name = text.partition("=")
        if key == "robot" and name.endswith(".urdf"):
            file = folder / name
            file.write_text(_urdf(int(name.removeprefix("arm").removesuffix(".urdf"))), encoding="utf-8")
            texts[texts.index(text)] = f"robot={file}"
        if key == "fixture" and _reads_a_file(name):
            mesh = folder / "mesh.off"
            mesh.write_text(_MESH, encoding="ascii")
            texts.append(f"fixture.{name}.file={mesh}")
        if text == "fixture=hole":  # a hole whose middle is not in the plate
            texts.append("fixture.keep_out=true")
    return api.configuration(job.scenario, texts=["teleop.duration=0.01", *texts])


def _compile(job: Job) -> int:
    """Number of kernels that were compiled to run a stage or a short session."""
    import tempfile

    from teleop_core.kernels.progress import compiled_count
    from teleop_core.session import api
    from teleop_core.session.virtual import VirtualTime

    before = compiled_count()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        configuration = configured_job(job, folder)
        if job.stage:
            _compile_stage(job.stage, configuration)
        elif job == Job():
            api.run(configuration, out=folder / "recording")
            api.replay(folder / "recording", out=folder / "replay")
        else:
            VirtualTime(configuration).run(1)
    return compiled_count() - before


def _compile_stage(stage: str, configuration: "Configuration") -> None:
    """Compile the kernels of a stage, also those of commands that a live slave accepts."""
    from teleop_core.graph.signals import DT
    from teleop_core.graph.stage import STAGES
    from teleop_core.slave.pair import ArmParameters, SimulatedArm

    if stage == _PAIR:
        SimulatedArm(ArmParameters()).load()
        return
    if stage == _MESSAGES:
        from teleop_core.nodes.ports import load_all

        load_all()
        return
    runner = STAGES.find(stage).run(configuration.groups[stage], DT)
    runner.load()
    if (motion := getattr(runner, "motion", None)) is not None:
        motion.load()
