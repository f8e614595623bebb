"""``teleop drill``: injects every known fault into a running session, and measures the reaction of the arm."""

import json
import tempfile
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from teleop_core.bags.finding import check_new
from teleop_core.base.errors import ParameterError
from teleop_core.commands.options import SessionOptions, ros_module
from teleop_drill.commands.options import Options

if TYPE_CHECKING:
    from teleop_drill.drill import Exercise, FaultOutcome


def drill(
    *names: Annotated[str, Parameter(name="NAME")],
    options: Options = Options(),
    settings: SessionOptions = SessionOptions(),
) -> int:
    """Inject all known faults into a running session, and measure the reaction of the arm.

    Without a name all faults are injected, which takes minutes:

        teleop drill --list                                       # what there is
        teleop drill stop_topic kill_motion_scaling
        teleop drill --short                                      # five faults, less than a minute
        teleop drill --simulated                                  # all on a simulated machine: the same bits every time
        teleop drill --simulated --seed 7 flood                   # with other delays, costs and discoveries
        teleop drill --seeds 100                                  # random faults at random times, and their laws
        teleop drill --search out/search --minutes 30             # faults where earlier ones have met least
        teleop drill --composed --json drill.json
        teleop drill --drives "python examples/foreign_slave.py"  # drives of your own
        teleop drill --drives "arm_bridge --ros-args --params-file arm.yaml" --arm "./controller"
        teleop drill --set real_time.priority=50                  # on a machine that others keep busy

    It starts sessions of its own, simulated, on a ROS domain of their own, kills and stops processes of these sessions
    alone, and keeps the machine's cores busy for seconds. Exit code 0: all as expected.

    Args:
        names: Faults; without a name, all.
        options: What is injected, and where.
        settings: Values of parameters.
    """
    from teleop_core.evaluation.command import check_places
    from teleop_drill.drill import SHORT, chosen

    if options.seeds is not None and options.seeds < 1:  # none would mean the drill in real processes
        raise ParameterError("--seeds", options.seeds, "at least 1")
    if any(one is not None for one in (options.seeds, options.search, options.schedule)):
        from teleop_drill.commands.seeds import run_schedules

        return run_schedules(names, options)
    exercises = chosen((*names, *(SHORT if options.short else ())), is_composed=options.composed)
    if options.list_:
        for one in exercises:
            print(f"{one.name:24} {one.text}")
        return 0
    options.check()
    check_places(options.json, options.markdown)
    check_new(options.out)
    outcomes = _outcomes(exercises, options, settings)
    _write(outcomes, options)
    code = _show(outcomes)
    if len(outcomes) < len(exercises):
        print(f"{len(exercises) - len(outcomes)} were not done")
        return 1
    return code


def _outcomes(exercises: "tuple[Exercise, ...]", options: Options, settings: SessionOptions) -> "list[FaultOutcome]":
    from rich.console import Console

    console = Console()

    def say(line: str) -> None:
        console.print(line, highlight=False, markup=False, soft_wrap=True)

    with ExitStack() as end:
        folder = options.out or Path(end.enter_context(tempfile.TemporaryDirectory(prefix="drill_")))
        if options.simulated:
            from teleop_core.nodes.crews import Processes

            return ros_module("drill", "teleop_drill.simulation").simulated_drill(  # type: ignore[no-any-return]
                exercises,
                folder,
                say,
                seed=options.seed,
                processes=Processes.ONE if options.composed else Processes.NODES,
                files=settings.config,
                texts=settings.texts,
            )
        return ros_module("drill", "teleop_drill.nodes").drill(  # type: ignore[no-any-return]
            exercises,
            folder,
            say,
            is_composed=options.composed,
            files=settings.config,
            texts=settings.texts,
            drives=options.drives,
            arm=options.arm,
        )


def _write(outcomes: "list[FaultOutcome]", options: Options) -> None:
    from teleop_core import __version__
    from teleop_core.evaluation.command import write_whole
    from teleop_drill.drill.drill_table import markdown

    if options.json is not None:
        found = [outcome.to_json() for outcome in outcomes]
        whole = {"version": __version__, "is_composed": options.composed, "faults": found}
        text = json.dumps(whole, indent=2, allow_nan=False, ensure_ascii=False)
        write_whole(options.json, text + "\n")
    if options.markdown is not None:
        write_whole(options.markdown, markdown(outcomes))


def _show(outcomes: "list[FaultOutcome]") -> int:
    from rich.console import Console

    from teleop_drill.drill.drill_table import drill_table, summary

    console = Console()
    wide = console if console.is_terminal else Console(width=170)
    wide.print(drill_table(outcomes))
    for line in summary(outcomes):
        print(line)
    return 1 if any(outcome.failures() for outcome in outcomes) else 0
