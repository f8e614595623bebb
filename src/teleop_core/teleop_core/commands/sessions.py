"""Commands that run, repeat, publish and score sessions."""

import warnings
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from teleop_core.base import SessionError, TeleopWarning
from teleop_core.commands.options import Nodes, SessionOptions, Words, done, ros_module
from teleop_core.commands.progress import shown_progress


def _duration(seconds: float | None) -> list[str]:
    return [] if seconds is None else [f"teleop.duration={seconds!r}"]


def sim(
    *,
    out: Path,
    scenario: str | None = None,
    duration: float | None = None,
    seed: int | None = None,
    settings: SessionOptions = SessionOptions(),
) -> None:
    """Run and record a session in virtual time.

    For example:

        teleop sim --scenario coarse_box --out bags/coarse
        teleop sim --scenario wall --robot puma560 --out bags/wall
        teleop sim --out bags/fine --set fine_gain=0.2 slave.command_timeout=0.2

    Args:
        out: Directory for the recording; it must not exist yet.
        scenario: Scenario, one of `teleop scenarios`.
        duration: Duration of the hand's motion [s]; without it, that of the scenario.
        seed: Seed of everything random; without it, that of the scenario.
        settings: Values of parameters.
    """
    from teleop_core.session.notes import notes_of
    from teleop_core.session.runner import simulate

    seeds = [] if seed is None else [f"seed={seed}"]
    configuration = settings.configured(scenario, _duration(duration) + seeds)
    for note in notes_of(configuration):
        warnings.warn(note, TeleopWarning, stacklevel=2)
    with shown_progress("simulating") as progress:
        simulate(configuration, out, progress)
    print(done(out, f"{progress.seconds:g} s recorded"))


def live(
    *,
    out: Path,
    scenario: str | None = None,
    duration: float | None = None,
    processes: Literal["sides", "nodes", "one"] = "sides",
    composed: Annotated[bool, Parameter(show_default=False)] = False,
    without: Nodes = (),
    settings: SessionOptions = SessionOptions(),
) -> None:
    """Run and record a session as ROS 2 nodes.

    For example:

        teleop live --scenario coarse_box --out bags/live
        teleop live --out bags/seen --set robot=cubes.xml scene.cameras=[front]  # with pictures
        teleop live --out bags/live --without slave_sim  # your own arm takes its place

    Args:
        out: Directory for the recording; it must not exist yet.
        scenario: Scenario, one of `teleop scenarios`.
        duration: Duration of the hand's motion [s]; without it, that of the scenario.
        processes: sides: one process for the hand's side and one for the slave's side; nodes: one for each node, so
            that you can replace or kill a node; one: one for all nodes, the fastest. The recorder always has its own
            process.
        composed: The same as --processes one.
        without: Do not start this node, because another node replaces it on the same ROS_DOMAIN_ID, as arm_bridge
            replaces slave_sim; may be repeated.
        settings: Values of parameters.
    """
    from rich.console import Console

    configuration = settings.configured(scenario, _duration(duration))
    module = ros_module("live")
    chosen = module.Processes("one" if composed else processes)
    try:
        module.live(configuration, out, Console(), processes=chosen, without=without)
    except SessionError:
        if (out / "metadata.yaml").exists():
            print(done(out, "recorded until it ended"))
        raise
    print(done(out, "recorded"))


def replay(
    bag: Path,
    /,
    *,
    out: Path,
    begin: Annotated[Literal["device", "hand"], Parameter(name="--from")] = "device",
    settings: SessionOptions = SessionOptions(),
) -> None:
    """Run a recorded master through the graph again, in virtual time.

    For example:

        teleop replay bags/coarse --out bags/unfiltered --set reference_filter.is_on=false

    Args:
        bag: Recording whose master is replayed.
        out: Directory for the recording; it must not exist yet.
        begin: device: replay the measured pose of the device; hand: replay the pose that the hand wanted; the device
            is simulated again with the forces of the new session.
        settings: Values of parameters.
    """
    from teleop_core.session import api

    with shown_progress("replaying") as progress:
        api.replay(bag, out=out, progress=progress, files=settings.config, texts=settings.texts, begin=begin)
    print(done(out, f"{progress.seconds:g} s replayed"))


def play(bag: Path, /, *, topics: Words = (), rate: float = 1.0) -> None:
    """Publish a recording on live ROS 2 topics.

    Args:
        bag: Recording to publish.
        topics: Publish only these topics.
        rate: Speed, as a multiple of real time.
    """
    from rich.console import Console

    from teleop_core.bags.reader import Bag

    ros_module("play").play(Bag(bag), list(topics) or None, rate, Console())


def evaluate(
    bags: tuple[Path, ...],
    /,
    *,
    json: Path | None = None,
    html: Path | None = None,
    differences: bool = False,
    span: Annotated[tuple[float, float] | None, Parameter(metavar="FROM TO")] = None,
) -> None:
    """Score recordings beside published figures.

    For example:

        teleop evaluate bags/coarse --html coarse.html
        teleop evaluate bags/coarse bags/unfiltered --differences

    Args:
        bags: Recordings to score.
        json: Write the scores as JSON.
        html: Write one page with plots.
        differences: Show only rows that differ between recordings, largest change first.
        span: Score only the messages recorded between these two times [s], counted from the first message.
    """
    from rich.console import Console

    from teleop_core.evaluation.command import evaluate_bags

    evaluate_bags(list(bags), json, html, Console(), span, differences=differences)


def recover(bag: Path, /, *, out: Path | None = None) -> None:
    """Save what a cut-off recording holds.

    Args:
        bag: Recording that was not closed.
        out: New recording; without it, BAG_recovered.
    """
    from teleop_core.bags.reader import recover as recovered

    path, messages = recovered(bag, out)
    print(f"{path}: {messages} messages recovered")
