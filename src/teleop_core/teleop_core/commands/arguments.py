"""Arguments that several commands share, and their evaluation."""

import argparse
import json
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from teleop_core.base.errors import ParameterError, TeleopError

if TYPE_CHECKING:
    from teleop_core.session.configuration import Configuration


def geometry_argument(parser: argparse.ArgumentParser, action: str | type[argparse.Action] = "store") -> None:
    """Add an argument to a command: lengths that replace the published lengths of the robot."""
    parser.add_argument(
        "--geometry",
        nargs="+",
        default=[],
        metavar="SYMBOL=VALUE",
        help="lengths and options that replace the published ones [m, rad], such as tip=tool0 of a URDF",
        action=action,
    )


class _Robot(argparse.Action):
    """Settings of another robot, before all others: geometry and start of the former robot do not hold for it."""

    def __call__(self, parser: Any, namespace: Any, values: Any, option_string: Any = None) -> None:
        namespace.settings = [f"robot={values}", "geometry=[]", "slave.start=[]", *namespace.settings]


class _Geometry(argparse.Action):
    """Setting of the robot's geometry."""

    def __call__(self, parser: Any, namespace: Any, values: Any, option_string: Any = None) -> None:
        namespace.settings = [*namespace.settings, f"geometry={json.dumps(values)}"]


def command(
    commands: Any, name: str, run: Callable[[argparse.Namespace], int], text: str, examples: str | None = None
) -> argparse.ArgumentParser:
    """Parser of a command, which calls ``run``; its help contains ``text``, then the examples."""
    parser: argparse.ArgumentParser = commands.add_parser(name, help=text, description=text, epilog=examples)
    if examples is not None:  # keep the line breaks of the source
        parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.set_defaults(run=run)
    parser.add_argument(
        "--parts",
        type=Path,
        action="append",
        default=[],
        metavar="FILE.py",
        dest="more_parts",
        help="Python file that registers parts of your own",
    )
    return parser


def out_argument(parser: argparse.ArgumentParser) -> None:
    """Add the argument of the recording's path to a command. An interrupted command keeps the recorded part."""
    parser.set_defaults(records=True)
    parser.add_argument("--out", type=Path, required=True, help="directory for the recording; it must not exist yet")


def domain_argument(parser: argparse.ArgumentParser, text: str) -> None:
    """Add the argument of a ROS domain to a command; ``text`` is its help."""
    parser.add_argument("--domain", type=_domain, metavar="N", help=text)


def _domain(text: str) -> int:
    from teleop_core.middleware.domains import checked_domain

    try:
        return checked_domain("domain", text)
    except ParameterError as error:
        raise argparse.ArgumentTypeError(str(error)) from error


def without_argument(parser: argparse.ArgumentParser) -> None:
    """Add the argument for nodes that are left out because other nodes replace them."""
    parser.add_argument(
        "--without",
        action="append",
        default=[],
        metavar="NODE",
        help="do not start this node, because another node replaces it on the same ROS_DOMAIN_ID, as "
        "arm_bridge replaces slave_sim; may be repeated",
    )


def session_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments that configure a session, beginning with the scenario."""
    parser.add_argument("--scenario", help="scenario, one of `teleop scenarios`")
    parser.add_argument(
        "--duration", type=float, metavar="S", help="duration of the hand's motion [s] (default: the scenario's)"
    )
    out_argument(parser)
    setting_arguments(parser)


def setting_arguments(parser: argparse.ArgumentParser, *, of_robot: bool = True) -> None:
    """Add the arguments for files and values of parameters; ``of_robot`` adds short forms for the robot's values."""
    parser.add_argument(
        "--config",
        type=Path,
        action="append",
        default=[],
        metavar="FILE",
        help="ROS 2 parameter file that overrides the scenario; may be repeated",
    )
    if of_robot:
        text = "slave: one of `teleop robot`, or a file, as --set robot=ROBOT"
        parser.add_argument("--robot", action=_Robot, metavar="ROBOT", help=text)
        geometry_argument(parser, _Geometry)
    parser.add_argument(
        "--set",
        nargs="+",
        action="extend",
        default=[],
        metavar="KEY=VALUE",
        dest="settings",
        help="set a parameter; it overrides all files, e.g. fine_gain=0.2 or slave.command_timeout=0.2",
    )


def settings(arguments: argparse.Namespace) -> list[str]:
    """Texts ``key=value`` of all given settings."""
    given = list(arguments.settings)
    if arguments.duration is not None:
        given.append(f"teleop.duration={arguments.duration!r}")
    if getattr(arguments, "seed", None) is not None:
        given.append(f"seed={arguments.seed}")
    return given


def configured(arguments: argparse.Namespace) -> "Configuration":
    """Configuration of a session from the command's arguments."""
    from teleop_core.session import api

    return api.configuration(arguments.scenario, files=arguments.config, texts=settings(arguments))


def done(out: Path, what: str) -> str:
    """Last line that a command prints after it has recorded."""
    return f"{out}: {what}; next: teleop evaluate {out}"


def ros_module(module: str, package: str = "teleop_core.nodes") -> Any:
    """Module of the nodes, which are the only part that needs ROS.

    Args:
        module: Name of the module in the package.
        package: The package of the module.

    Raises:
        TeleopError: ROS is missing.
    """
    from importlib import import_module

    try:
        return import_module(f"{package}.{module}")
    except ModuleNotFoundError as error:
        if (error.name or "").startswith("teleop_"):
            raise
        raise TeleopError(
            f"needs ROS 2 ({error.name} is missing): pip install 'teleop_core[ros]' or source ROS"
        ) from error
