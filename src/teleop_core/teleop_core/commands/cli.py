"""The ``teleop`` command: simulate, run live, replay, play, score and show information.

Imports are inside the commands, so that ``teleop --help`` answers at once.
"""

import argparse
import os
import sys
import warnings
from functools import cache
from pathlib import Path
from typing import Any, NoReturn

from teleop_core.base import ParameterError, SessionError, TeleopError, TeleopWarning, one_line
from teleop_core.commands import compiling, devices, installed, look, operate
from teleop_core.commands.arguments import (
    command,
    configured,
    done,
    geometry_argument,
    out_argument,
    ros_module,
    session_arguments,
    setting_arguments,
    without_argument,
)
from teleop_core.commands.progress import shown_progress

FAILED = 2
INTERRUPTED = 130

_EPILOG = """\
a first session:
  teleop sim --scenario coarse_box --out bags/coarse    record 46 s of teleoperation
  teleop evaluate bags/coarse --html coarse.html        score it, look at it
  teleop replay bags/coarse --out bags/unfiltered --set reference_filter.is_on=false
a hand of your own:
  teleop import hand.csv --out bags/hand                CSV, Parquet, bags: see import --help
  teleop replay bags/hand --out bags/answer             let the slave follow it
  teleop export bags/answer --out answer.csv            or .parquet, or a LeRobot data set
"""


class _Parser(argparse.ArgumentParser):
    """Parser whose errors are one line."""

    def error(self, message: str) -> NoReturn:
        self.exit(FAILED, f"{self.prog}: {message} (see {self.prog} --help)\n")


def main(arguments: list[str] | None = None) -> int:
    """Entry point of ``teleop``; returns the exit code: 0, 2 for wrong use, 130 for Ctrl-C."""
    if "_ARGCOMPLETE" in os.environ:  # a shell requests completions
        from argcomplete import autocomplete

        autocomplete(_parser())
    parsed = _parsed(sys.argv[1:] if arguments is None else arguments)
    warnings.showwarning = _note  # type: ignore[assignment]
    try:
        _take_parts([*parsed.parts, *parsed.more_parts])
        code: int = parsed.run(parsed)
    except TeleopError as error:
        print(f"teleop {parsed.command}: {error}", file=sys.stderr)
        return FAILED
    except KeyboardInterrupt:
        kept = "; what was recorded is kept" if getattr(parsed, "records", False) else ""
        print(f"teleop {parsed.command}: interrupted{kept}", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:  # the reader of the output, such as head, has closed it
        sys.stderr.close()
        return 0
    except OSError as error:  # the error of a file that cannot be read or written is clear by itself
        about = f"{error.filename}: {error.strerror}" if error.filename else str(error)
        print(f"teleop {parsed.command}: {one_line(about)}", file=sys.stderr)
        return FAILED
    return code


def _note(message: Warning | str, *_: object) -> None:
    print(f"note: {one_line(str(message))}", file=sys.stderr)


def _take_parts(files: list[Path]) -> None:
    """Load files with a user's parts in this process, and in every process that it starts."""
    from teleop_core.base.own_parts import load_own_parts

    load_own_parts(files)


def _parsed(words: list[str]) -> argparse.Namespace:
    """Parsed arguments of a command; installed packages are searched only if the command is not in the core."""
    parser, commands = _core()
    name = _command_of(words)
    if name not in commands.choices:
        _parser()
    if name is not None and name not in commands.choices and (text := installed.advice(name)):
        parser.exit(FAILED, f"{parser.prog} {name}: {text}\n")
    return parser.parse_args(words)


def _command_of(words: list[str]) -> str | None:
    """First word that is neither an option nor the value of one."""
    following = iter(words)
    for word in following:
        if word == "--parts":
            next(following, None)
        elif not word.startswith("-"):
            return word
    return None


@cache
def _parser() -> argparse.ArgumentParser:
    parser, commands = _core()
    installed.add(commands)
    return parser


@cache
def _core() -> tuple[argparse.ArgumentParser, Any]:
    """Parser of this package's commands, and the object to which further commands are added."""
    parser = _Parser(
        prog="teleop",
        description="Master-slave teleoperation: simulate, record, replay and score sessions.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    from teleop_core import __version__

    parser.add_argument(
        "--parts",
        type=Path,
        action="append",
        default=[],
        metavar="FILE.py",
        help="Python file that registers parts of your own, which --set then takes by name",
    )
    parser.add_argument("--version", action="version", version=__version__)
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for add in (_add_sim, _add_live, _add_replay, _add_play, _add_evaluate, _add_lookups):
        add(commands)
    for module in (operate, look, devices, compiling):
        module.add(commands)
    return parser, commands


def _add_sim(commands: Any) -> None:
    sim = command(commands, "sim", _sim, "run and record a session in virtual time")
    session_arguments(sim)
    sim.add_argument("--seed", type=int, help="seed of everything random")


def _add_live(commands: Any) -> None:
    live = command(commands, "live", _live, "run and record a session as ROS 2 nodes")
    session_arguments(live)
    live.add_argument(
        "--processes",
        choices=("sides", "nodes", "one"),
        default="sides",
        help="sides: one process for the hand's side and one for the slave's side (default); nodes: "
        "one for each node, so that you can replace or kill a node; one: one for all nodes, the "
        "fastest. The recorder always has its own process",
    )
    live.add_argument(
        "--composed", action="store_const", dest="processes", const="one", help="the same as --processes one"
    )
    without_argument(live)


def _add_replay(commands: Any) -> None:
    text = "run a recorded master through the graph again, in virtual time"
    again = command(commands, "replay", _replay, text)
    again.add_argument("bag", type=Path, help="recording whose master is replayed")
    again.add_argument(
        "--from",
        dest="begin",
        choices=("device", "hand"),
        default="device",
        help="device: replay the measured pose of the device (default); hand: replay the pose that "
        "the hand wanted; the device is simulated again with the forces of the new session",
    )
    out_argument(again)
    setting_arguments(again)


def _add_play(commands: Any) -> None:
    play = command(commands, "play", _play, "publish a recording on live ROS 2 topics")
    play.add_argument("bag", type=Path, help="recording to publish")
    play.add_argument("--topics", nargs="+", metavar="TOPIC", help="publish only these topics (default: all)")
    play.add_argument("--rate", type=float, default=1.0, help="speed, as a multiple of real time (default: 1)")


def _add_evaluate(commands: Any) -> None:
    score = command(commands, "evaluate", _evaluate, "score recordings beside published figures")
    score.add_argument("bags", type=Path, nargs="+", metavar="BAG", help="recordings to score")
    score.add_argument("--json", type=Path, metavar="FILE", help="write the scores as JSON")
    score.add_argument("--html", type=Path, metavar="FILE", help="write one page with plots")
    score.add_argument(
        "--differences", action="store_true", help="show only rows that differ between recordings, largest change first"
    )
    score.add_argument(
        "--span",
        type=float,
        nargs=2,
        metavar=("FROM", "TO"),
        help="score only the messages recorded between these two times [s], counted from the first message",
    )


def _add_lookups(commands: Any) -> None:
    recover = command(commands, "recover", _recover, "save what a cut-off recording holds")
    recover.add_argument("bag", type=Path, help="recording that was not closed")
    recover.add_argument("--out", type=Path, help="new recording (default: BAG_recovered)")
    command(commands, "scenarios", _scenarios, "list the scenarios")
    text = "list the parts that --set and teleop.stages take by name, your own included"
    command(commands, "parts", _parts, text)
    text = "list every parameter with unit, bounds and meaning"
    parameters = command(commands, "parameters", _parameters, text)
    parameters.add_argument("stage", nargs="?", help="print only the parameters of this stage")
    parameters.add_argument("--markdown", action="store_true", help="print a Markdown table for documents")
    robot = command(commands, "robot", _robot, "show a robot: joints, limits, home, tip pose")
    robot.add_argument("name", nargs="?", help="name or file of a robot; without it, all robots are listed")
    geometry_argument(robot)
    robot.add_argument(
        "--from",
        type=Path,
        dest="table",
        metavar="TABLE.yaml",
        help="file with a Denavit-Hartenberg table of a robot, as in config/robots",
    )
    robot.add_argument(
        "--urdf", type=Path, metavar="FILE", help="write the robot's links and joints to a URDF, for other tools"
    )
    text = "draw where a robot's tip can be"
    space = command(commands, "workspace", _workspace, text)
    space.add_argument("name", metavar="ROBOT", help="one of `teleop robot`")
    geometry_argument(space)
    space.add_argument("--html", type=Path, metavar="FILE", help="page with the picture")
    space.add_argument("--csv", type=Path, metavar="FILE", help="x, y, z, manipulability")
    space.add_argument("--samples", type=int, default=20_000, help="number of joint vectors to draw")
    space.add_argument("--seed", type=int, default=1, help="seed of the draws")


def _sim(arguments: argparse.Namespace) -> int:
    from teleop_core.session.notes import notes_of
    from teleop_core.session.runner import simulate

    configuration = configured(arguments)
    for note in notes_of(configuration):
        warnings.warn(note, TeleopWarning, stacklevel=2)
    with shown_progress("simulating") as progress:
        simulate(configuration, arguments.out, progress)
    print(done(arguments.out, f"{progress.seconds:g} s recorded"))
    return 0


def _replay(arguments: argparse.Namespace) -> int:
    from teleop_core.session import api

    with shown_progress("replaying") as progress:
        api.replay(
            arguments.bag,
            out=arguments.out,
            progress=progress,
            files=arguments.config,
            texts=arguments.settings,
            begin=arguments.begin,
        )
    print(done(arguments.out, f"{progress.seconds:g} s replayed"))
    return 0


def _live(arguments: argparse.Namespace) -> int:
    from rich.console import Console

    configuration = configured(arguments)
    module = ros_module("live")
    processes = module.Processes(arguments.processes)
    try:
        module.live(configuration, arguments.out, Console(), processes=processes, without=arguments.without)
    except SessionError:
        if (arguments.out / "metadata.yaml").exists():
            print(done(arguments.out, "recorded until it ended"))
        raise
    print(done(arguments.out, "recorded"))
    return 0


def _play(arguments: argparse.Namespace) -> int:
    from rich.console import Console

    from teleop_core.bags.reader import Bag

    bag, rate = Bag(arguments.bag), arguments.rate
    ros_module("play").play(bag, arguments.topics, rate, Console())
    return 0


def _evaluate(arguments: argparse.Namespace) -> int:
    from rich.console import Console

    from teleop_core.evaluation.command import evaluate_bags

    span = tuple(arguments.span) if arguments.span else None
    evaluate_bags(arguments.bags, arguments.json, arguments.html, Console(), span, differences=arguments.differences)
    return 0


def _recover(arguments: argparse.Namespace) -> int:
    from teleop_core.bags.reader import recover

    path, messages = recover(arguments.bag, arguments.out)
    print(f"{path}: {messages} messages recovered")
    return 0


def _scenarios(_: argparse.Namespace) -> int:
    from teleop_core.graph.layers import list_scenarios

    for name, description in list_scenarios().items():
        print(f"{name:16} {description}")
    return 0


def _parts(_: argparse.Namespace) -> int:
    from teleop_core.coupling.architectures import ARCHITECTURES
    from teleop_core.coupling.filters import TREMOR_FILTERS
    from teleop_core.coupling.network import NETWORKS
    from teleop_core.coupling.passivity import PASSIVITIES
    from teleop_core.evaluation import METRICS
    from teleop_core.graph.stage import STAGES
    from teleop_core.hand.operators import OPERATORS
    from teleop_core.hand.tasks import TASKS
    from teleop_core.robots import ROBOTS
    from teleop_core.shapes import SHAPES
    from teleop_core.slave.bridges import BRIDGES
    from teleop_core.slave.controllers import CONTROLLERS
    from teleop_core.slave.plants import PLANTS
    from teleop_core.slave.world import WORLD_OBJECTS

    parts = (
        OPERATORS, SHAPES, ROBOTS, CONTROLLERS, PLANTS, WORLD_OBJECTS, ARCHITECTURES, NETWORKS,
        PASSIVITIES, TREMOR_FILTERS, TASKS, BRIDGES, STAGES, METRICS,
    )  # fmt: skip
    for registry in parts:
        print(f"{registry.kinds:16}{', '.join(registry)}")
    return 0


def _parameters(arguments: argparse.Namespace) -> int:
    from teleop_core.base.errors import UnknownNameError
    from teleop_core.graph.layers import declared_groups
    from teleop_core.session.configuration import parameter_rows

    groups = declared_groups()
    if arguments.stage is not None and arguments.stage not in groups:
        raise UnknownNameError("stage", arguments.stage, groups)
    rows = parameter_rows([arguments.stage] if arguments.stage else groups)
    if arguments.markdown:
        print("| parameter | default | allowed | meaning |\n|---|---|---|---|")
        for row in rows:
            print("| `" + " | ".join((f"{row[0]}`", *row[1:])) + " |")
        return 0
    for name, default, allowed, text in rows:
        print(f"{name:42} {default:18} {text} ({allowed})")
    return 0


def _robot(arguments: argparse.Namespace) -> int:
    from teleop_core.robots import list_robots, load_robot_set
    from teleop_core.robots.description import text

    if arguments.table is not None:
        from teleop_core.robots.arms.dh import load_table

        robot = load_table(arguments.table).robot()
    elif arguments.name is not None:
        robot = load_robot_set(arguments.name, arguments.geometry)
    else:
        print("\n".join(list_robots()))
        return 0
    if arguments.urdf is not None:
        from teleop_core.robots.bodies import urdf_of

        arguments.urdf.write_text(urdf_of(robot), encoding="utf-8")
        print(f"{arguments.urdf}: {robot.name}")
        return 0
    print(text(robot))
    for note in robot.notes:
        print(f"note: {note}")
    return 0


def _workspace(arguments: argparse.Namespace) -> int:
    import numpy as np

    from teleop_core.evaluation.command import page_maker
    from teleop_core.robots import load_robot_set
    from teleop_core.robots.dexterity import sample_workspace, write_workspace_csv

    if arguments.seed < 0:
        raise ParameterError("--seed", arguments.seed, "0 or more")
    write_page = page_maker("workspace") if arguments.html is not None else None
    robot = load_robot_set(arguments.name, arguments.geometry)
    rng = np.random.default_rng(arguments.seed)
    points, values = sample_workspace(robot, arguments.samples, rng)
    if len(points) < arguments.samples:
        print(f"{len(points)} of {arguments.samples} joint vectors assemble as at home")
    low, high = points.min(axis=0), points.max(axis=0)
    for axis, begin, end in zip("xyz", low, high, strict=True):
        print(f"{axis}: {begin:8.4f} … {end:8.4f} m")
    if arguments.csv is not None:
        write_workspace_csv(arguments.csv, points, values)
        print(arguments.csv)
    if write_page is not None:
        write_page(robot, points, values, arguments.html)
        print(arguments.html)
    return 0


if __name__ == "__main__":
    sys.exit(main())
