"""The ``teleop`` command: its table of commands, and how it ends.

A command is a typed function with a docstring; cyclopts reads its options from them. Only the module of the command
that runs is imported. ``teleop --help`` needs none, so that it answers at once.
"""

import sys
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Annotated

from teleop_core.base import TeleopError, UnknownNameError, one_line

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint
    from inspect import BoundArguments

    from cyclopts import App

FAILED = 2
INTERRUPTED = 130
GROUP = "teleop_core.commands"
"""Entry-point group of installed packages: ``polish = "my_package.commands:polish"`` names a function."""
COMMANDS = {
    "teleop_core.commands.sessions": {
        "sim": "Run and record a session in virtual time",
        "live": "Run and record a session as ROS 2 nodes",
        "replay": "Run a recorded master through the graph again, in virtual time",
        "play": "Publish a recording on live ROS 2 topics",
        "evaluate": "Score recordings beside published figures",
        "recover": "Save what a cut-off recording holds",
    },
    "teleop_core.commands.listing": {
        "scenarios": "List the scenarios",
        "parts": "List the parts that --set and teleop.stages take by name, your own included",
        "parameters": "List every parameter with unit, bounds and meaning",
        "robot": "Show a robot: joints, limits, home, tip pose",
        "workspace": "Draw where a robot's tip can be",
    },
    "teleop_core.commands.operate": {
        "stop": "Emergency stop of the arms that run here",
        "operate": "Enable, home, pause or reset arms, or show their states",
    },
    "teleop_core.commands.look": {
        "topic": "List topics of running nodes, measure rates, print messages",
        "param": "List, read and set parameters of running nodes",
        "service": "List services of running nodes, and call one",
        "info": "Show the topics and the metadata of a recording",
    },
    "teleop_core.commands.devices": {
        "devices": "List gamepads and 3-D mice of this machine, for --set operator=gamepad or spacemouse"
    },
    "teleop_core.commands.compiling": {"compile": "Compile all kernels now, on all processors"},
    "teleop_console.commands": {"console": "See a session in the browser, drive it, replay a recording"},
    "teleop_exchange.commands": {
        "import": "Turn a file from another system into a recording",
        "export": "Write recordings as tables or a data set",
    },
    "teleop_scene.camera_commands": {
        "camera": "Publish pictures of a live session with a scene, from a process of its own",
        "film": "Write a copy of a recording that has the pictures of cameras too",
    },
    "teleop_scene.commands": {"scenes": "List MuJoCo models that a session can use, or the arms of one"},
    "teleop_lab.commands.calibrate": {
        "calibrate": "Find joint offsets and link errors of an arm from measured places of its tip"
    },
    "teleop_lab.commands.experiment": {
        "experiment": "Repeat what the sources did, and print predicted beside published figures"
    },
    "teleop_lab.commands.fit": {
        "fit": "Fit friction, bias and weights of the hardware plant to where a machine came to rest"
    },
    "teleop_lab.commands.grade": {"grade": "Figures of motion of every episode of a data set, the oddest first"},
    "teleop_lab.commands.people": {
        "people": "Conduct a study with people in the browser, and compare them with the simulated operator"
    },
    "teleop_lab.commands.reach": {
        "reach": "Say how much of a hand's motion a slave can follow, and propose where to put it"
    },
    "teleop_lab.commands.study": {
        "study": "Run sessions over named values of parameters and seeds, and compare their scores"
    },
    "teleop_lab.commands.tune": {"tune": "Search the values of parameters with which a score is best"},
    "teleop_drill.commands.conformance": {
        "conformance": "Test a CRTK arm, row by row: topics, stamps, states, small motions"
    },
    "teleop_drill.commands.drill": {
        "drill": "Inject all known faults into a running session, and measure the reaction of the arm"
    },
}
"""Commands of this project by module, each with the first line of its docstring, so that a list imports no module."""
_ABOUT = "Master-slave teleoperation: simulate, record, replay and score sessions."
_USAGE = """\
options:
  --help                   this text; `teleop COMMAND --help` has the options of a command
  --parts FILE.py          register parts of your own, which --set then takes by name; may be repeated
  --version                version of the program
  --install-completion     let this shell complete commands and options by tab

a first session:
  teleop sim --scenario coarse_box --out bags/coarse    # record 46 s of teleoperation
  teleop evaluate bags/coarse --html coarse.html        # score it, look at it
  teleop replay bags/coarse --out bags/unfiltered --set reference_filter.is_on=false
a hand of your own:
  teleop import hand.csv --out bags/hand                # CSV, Parquet, bags: see import --help
  teleop replay bags/hand --out bags/answer             # let the slave follow it
  teleop export bags/answer --out answer.csv            # or .parquet, or a LeRobot data set"""


@dataclass(frozen=True)
class Call:
    """A command with its arguments."""

    name: str
    parts: tuple[Path, ...]
    command: Callable[..., int | None]
    arguments: "BoundArguments"

    def run(self) -> int:
        """Run the command after the files with a user's parts; returns the exit code."""
        from teleop_core.base.own_parts import load_own_parts

        load_own_parts(self.parts)
        return self.command(*self.arguments.args, **self.arguments.kwargs) or 0

    @property
    def has_recorded(self) -> bool:
        """Whether there is a recording that the command was asked to make."""
        out = self.arguments.arguments.get("out")
        return isinstance(out, Path) and any(out.glob("*.mcap"))


def main(words: list[str] | None = None) -> int:
    """Entry point of ``teleop``; returns the exit code: 0, 2 for wrong use, 130 for Ctrl-C."""
    words = sys.argv[1:] if words is None else words
    call = None
    try:
        if words in (["--help"], ["-h"]):
            print(overview(), flush=True)
            return 0
        warnings.showwarning = _note  # type: ignore[assignment]
        call = parse(words)
        return 0 if call is None else call.run()
    except TeleopError as error:
        return _failed(words, str(error))
    except KeyboardInterrupt:
        kept = "; what was recorded is kept" if call is not None and call.has_recorded else ""
        _failed(words, f"interrupted{kept}")
        return INTERRUPTED
    except BrokenPipeError:  # the reader of the output, such as head, has closed it
        sys.stderr.close()
        return 0
    except OSError as error:  # the error of a file that cannot be read or written is clear by itself
        return _failed(words, one_line(f"{error.filename}: {error.strerror}" if error.filename else str(error)))


def _failed(words: list[str], text: str) -> int:
    print(f"teleop {_command_of(words)}".rstrip() + f": {text}", file=sys.stderr)
    return FAILED


def _note(message: Warning | str, *_: object) -> None:
    print(f"note: {one_line(str(message))}", file=sys.stderr)


def _command_of(words: list[str]) -> str:
    """First word that is neither an option nor a file with parts."""
    return next((word for word in words if not word.startswith("-") and not word.endswith(".py")), "")


def parse(words: list[str]) -> Call | None:
    """Command that the words name, with its arguments; None if the words ask for help, which is then printed.

    Raises:
        TeleopError: The words name no command, its options are wrong, or its distribution is not installed.
    """
    from cyclopts import CycloptsError, Parameter
    from cyclopts.exceptions import UnusedCliTokensError

    if not words:
        raise TeleopError("a COMMAND is missing (see teleop --help)")
    name = _command_of(words)
    app = application(name)

    def launch(
        *tokens: Annotated[str, Parameter(show=False, allow_leading_hyphen=True)],
        parts: Annotated[tuple[Path, ...], Parameter(consume_multiple=False, metavar="FILE.py")] = (),
    ) -> Call:
        """Read the options of every command, then the command.

        Args:
            tokens: The command with its own options.
            parts: Python file that registers parts of your own; may be repeated.
        """
        command, arguments, _ = app.parse_args(tokens, exit_on_error=False, print_error=False)
        return Call(name, parts, command, arguments)

    app.meta.default(launch)
    try:
        return app.meta(words, exit_on_error=False, print_error=False)
    except CycloptsError as error:
        error.verbose = False  # without the place in the source
        told = str(error.__cause__ if isinstance(error.__cause__, TeleopError) else error)
        if isinstance(error, UnusedCliTokensError):
            told = f"one argument too many: {(error.unused_tokens or [''])[0]}"
        raise TeleopError(f"{one_line(told).rstrip('.')} (see teleop {name} --help)") from error


def application(name: str = "") -> "App":
    """Application of cyclopts with all commands of this project, and with the installed command ``name``.

    Raises:
        TeleopError: The distribution of the command is not installed.
    """
    from cyclopts import App, Parameter

    from teleop_core import __version__

    common = Parameter(negative=(), consume_multiple=1, show_default=_shown_default)
    app = App(
        name="teleop",
        help=_ABOUT,
        version=__version__,
        help_format="markdown",
        default_parameter=common,
        result_action="return_value",
    )
    for module, commands in COMMANDS.items():
        if find_spec(package := module.partition(".")[0]) is None:
            if name in commands:
                raise TeleopError(f"install {package}, which has this command")
            continue
        for one in commands:
            app.command(f"{module}:{one}{'_' * (one in {'compile', 'import'})}", name=one)
    if name not in app:
        for entry in installed():
            app.command(loaded(entry), name=entry.name)
    app.register_install_completion_command(show=False)
    if name and name not in app:
        raise UnknownNameError("COMMAND", name, (one for one in app if not one.startswith("-")))
    return app


def _shown_default(value: object) -> str | None:
    return None if value in (None, (), False, "") else str(value)


def installed() -> "list[EntryPoint]":
    """Commands of installed packages that are not of this project, by name."""
    from importlib.metadata import entry_points

    ours = {name for commands in COMMANDS.values() for name in commands}
    return sorted((one for one in entry_points(group=GROUP) if one.name not in ours), key=lambda one: one.name)


def loaded(entry: "EntryPoint") -> Callable[..., int | None]:
    """Function of an installed command; one that cannot be loaded becomes a function that says so."""
    try:
        return entry.load()
    except Exception as error:  # any exception of a foreign module becomes one line that names the module
        reason = one_line(f"cannot be loaded from {entry.value}: {type(error).__name__}: {error}")

    def refuse() -> int:
        raise TeleopError(reason)

    refuse.__doc__ = reason
    return refuse


def overview() -> str:
    """Text of ``teleop --help``: what there is, without an import of any command of this project."""
    rows = {
        name: text
        for module, commands in COMMANDS.items()
        for name, text in commands.items()
        if find_spec(module.partition(".")[0]) is not None
    }
    rows |= {entry.name: (loaded(entry).__doc__ or "").partition("\n")[0].rstrip(".") for entry in installed()}
    lines = (fill(text, 88, initial_indent=f"  {name:13}", subsequent_indent=15 * " ") for name, text in rows.items())
    return "\n".join(("usage: teleop [--parts FILE.py] COMMAND ...\n", _ABOUT, "\ncommands:", *lines, "", _USAGE))


if __name__ == "__main__":
    sys.exit(main())
