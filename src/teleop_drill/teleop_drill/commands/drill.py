"""``teleop drill``: injects every known fault into a running session, and measures the reaction of the arm."""

import argparse
import json
import shlex
import tempfile
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

from teleop_core.bags.finding import check_new
from teleop_core.base.errors import ParameterError
from teleop_core.commands.arguments import command, ros_module, setting_arguments

if TYPE_CHECKING:
    from teleop_drill.drill import Exercise, Outcome

_EPILOG = """\
without a name all faults are injected, which takes minutes:
  teleop drill --list                      what there is
  teleop drill stop_topic kill_motion_scaling
  teleop drill --short                     five faults, less than a minute
  teleop drill --simulated                 all on a simulated machine: the same bits every time
  teleop drill --simulated --seed 7 flood  with other delays, costs and discoveries
  teleop drill --seeds 100                 random faults at random times, and laws that must hold
  teleop drill --composed --json drill.json
  teleop drill --drives "python examples/foreign_slave.py"    drives of your own
  teleop drill --drives "arm_bridge --ros-args --params-file arm.yaml" --arm "./controller"
  teleop drill --set real_time.priority=50  on a machine that others keep busy
it starts sessions of its own, simulated, on a ROS domain of their own, kills and stops processes of
these sessions alone, and keeps the machine's cores busy for seconds. Exit code 0: all as expected.
"""


def add(commands: Any) -> None:
    """Add the command's parser."""
    text = "inject all known faults into a running session, and measure the reaction of the arm"
    parser = command(commands, "drill", _run, text, _EPILOG)
    parser.add_argument("names", nargs="*", metavar="NAME", help="faults (default: all)")
    parser.add_argument("--composed", action="store_true", help="all nodes in one process")
    parser.add_argument("--short", action="store_true", help="run only five faults that show the most")
    parser.add_argument(
        "--simulated",
        action="store_true",
        help="simulate processes, clocks, disk and middleware, with random numbers from --seed",
    )
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="seed of the simulated machine (default: 0)")
    parser.add_argument(
        "--seeds",
        type=int,
        default=None,
        metavar="N",
        help="run this number of random schedules of faults on the simulated machine; their seeds begin at --seed",
    )
    parser.add_argument(
        "--breaks",
        type=float,
        default=0.0,
        metavar="SHARE",
        help="in schedules, share of clock readings after which another thread runs (default: 0; try 0.0005)",
    )
    parser.add_argument("--faults", metavar="I,K", help="run only these faults of one schedule; -: none")
    parser.add_argument("--list", action="store_true", dest="is_list", help="list the faults")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all numbers as JSON")
    parser.add_argument("--markdown", type=Path, metavar="FILE", help="write the table as Markdown")
    parser.add_argument(
        "--drives",
        metavar="COMMAND",
        type=shlex.split,
        default=(),
        help="command that starts drives; they replace the simulated ones",
    )
    parser.add_argument(
        "--arm",
        metavar="COMMAND",
        type=shlex.split,
        default=(),
        help="command that starts the arm that the drives of --drives move; the drill does not disturb it",
    )
    parser.add_argument(
        "--out", type=Path, metavar="DIR", help="directory that keeps the recordings; it must not exist yet"
    )
    setting_arguments(parser)


def _run(arguments: argparse.Namespace) -> int:
    from teleop_core.evaluation.command import check_places
    from teleop_drill.drill import SHORT, chosen

    if arguments.seeds is not None and arguments.seeds < 1:  # none would mean the drill in real processes
        raise ParameterError("--seeds", arguments.seeds, "at least 1")
    if arguments.seeds is not None or arguments.faults is not None:
        from teleop_drill.commands.seeds import run_schedules

        return run_schedules(arguments)
    names = (*arguments.names, *(SHORT if arguments.short else ()))
    exercises = chosen(names, is_composed=arguments.composed)
    if arguments.is_list:
        for one in exercises:
            print(f"{one.name:24} {one.text}")
        return 0
    if arguments.drives and arguments.composed:
        raise ParameterError("--drives", shlex.join(arguments.drives), "given without --composed")
    if arguments.simulated and arguments.drives:
        raise ParameterError("--drives", shlex.join(arguments.drives), "given without --simulated")
    if arguments.seed and not arguments.simulated:
        raise ParameterError("--seed", arguments.seed, "given with --simulated only")
    if arguments.arm and not arguments.drives:
        raise ParameterError("--arm", shlex.join(arguments.arm), "given with --drives only, whose drives move the arm")
    check_places(arguments.json, arguments.markdown)
    check_new(arguments.out)
    outcomes = _outcomes(exercises, arguments)
    _write(outcomes, arguments)
    code = _show(outcomes)
    if len(outcomes) < len(exercises):
        print(f"{len(exercises) - len(outcomes)} were not done")
        return 1
    return code


def _outcomes(exercises: "tuple[Exercise, ...]", arguments: argparse.Namespace) -> "list[Outcome]":
    from rich.console import Console

    console, out = Console(), arguments.out

    def say(line: str) -> None:
        console.print(line, highlight=False, markup=False, soft_wrap=True)

    with ExitStack() as end:
        folder = out or Path(end.enter_context(tempfile.TemporaryDirectory(prefix="drill_")))
        if arguments.simulated:
            from teleop_core.nodes.crews import Processes

            return ros_module("drill", "teleop_drill.simulation").simulated_drill(  # type: ignore[no-any-return]
                exercises,
                folder,
                say,
                seed=arguments.seed,
                processes=Processes.ONE if arguments.composed else Processes.NODES,
                files=arguments.config,
                texts=arguments.settings,
            )
        return ros_module("drill", "teleop_drill.nodes").drill(  # type: ignore[no-any-return]
            exercises,
            folder,
            say,
            is_composed=arguments.composed,
            files=arguments.config,
            texts=arguments.settings,
            drives=arguments.drives,
            arm=arguments.arm,
        )


def _write(outcomes: "list[Outcome]", arguments: argparse.Namespace) -> None:
    from teleop_core import __version__
    from teleop_core.evaluation.command import write_whole
    from teleop_drill.drill.drill_table import markdown

    if arguments.json is not None:
        found = [outcome.to_json() for outcome in outcomes]
        whole = {"version": __version__, "is_composed": arguments.composed, "faults": found}
        text = json.dumps(whole, indent=2, allow_nan=False, ensure_ascii=False)
        write_whole(arguments.json, text + "\n")
    if arguments.markdown is not None:
        write_whole(arguments.markdown, markdown(outcomes))


def _show(outcomes: "list[Outcome]") -> int:
    from rich.console import Console

    from teleop_drill.drill.drill_table import drill_table, summary

    console = Console()
    wide = console if console.is_terminal else Console(width=170)
    wide.print(drill_table(outcomes))
    for line in summary(outcomes):
        print(line)
    return 1 if any(outcome.failures() for outcome in outcomes) else 0
