"""``teleop reach``: the share of a recorded hand's motion that a slave can follow, and the settings that enlarge it."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from teleop_core.base.errors import TeleopError
from teleop_core.commands.arguments import command, setting_arguments

if TYPE_CHECKING:
    from teleop_lab.planning.reach_result import Reach

_EPILOG = """\
shares are of the time: as given, and with a start of the slave, an order of axes and gains that
reach the goal with the largest gains. Take them as they are printed, or as a file:
  teleop reach bags/hand --robot rcrt1 --html reach.html --out reach.yaml
  teleop replay bags/hand --out bags/followed --robot rcrt1 --config reach.yaml
"""


def add(commands: Any) -> None:
    """Add the command's parser."""
    text = "say how much of a hand's motion a slave can follow, and propose where to put it"
    parser = command(commands, "reach", _run, text, _EPILOG)
    parser.add_argument(
        "sources",
        nargs="+",
        metavar="BAG|SCENARIO",
        help="recording, in our or a foreign format, or one of `teleop scenarios`",
    )
    parser.add_argument("--arm", default="", help="namespace of the arm (default: the first)")
    parser.add_argument(
        "--share",
        type=float,
        default=99.0,
        metavar="PERCENT",
        help="share of the time for which the slave should be able to follow [%%] (default: 99)",
    )
    parser.add_argument(
        "--keep-axes", action="store_true", help="do not propose another map of axes from hand to slave"
    )
    parser.add_argument("--html", type=Path, metavar="FILE", help="page with pictures")
    parser.add_argument(
        "--out",
        type=Path,
        metavar="FILE.yaml",
        help="write the proposal as a ROS 2 parameter file for --config; needs a single recording",
    )
    setting_arguments(parser)


def _run(arguments: argparse.Namespace) -> int:
    from teleop_core.evaluation.command import check_places

    if arguments.out is not None and len(arguments.sources) > 1:
        raise TeleopError("--out writes the proposal for one recording; give a single recording, or leave out --out")
    check_places(arguments.html, arguments.out)
    if not 0.0 < arguments.share <= 100.0:
        raise TeleopError(f"--share {arguments.share:g} must be above 0 and at most 100 percent")
    found = [_reach(source, arguments) for source in arguments.sources]
    print("\n\n".join(map(str, found)))
    if arguments.html is not None:
        from teleop_lab.planning.page import write_reach_page

        write_reach_page(found, arguments.html)
        print(f"page: {arguments.html}")
    if arguments.out is not None:
        arguments.out.write_text(found[0].parameter_file(), encoding="utf-8")
        print(f"parameters: {arguments.out}; take them with --config {arguments.out}")
    return 0


def _reach(source: str, arguments: argparse.Namespace) -> "Reach":
    from teleop_core.commands.progress import shown_progress
    from teleop_lab.planning.reach import reach

    with shown_progress(f"searching, {Path(source).name}") as progress:
        return reach(
            source,
            arm=arguments.arm,
            share=arguments.share / 100.0,
            keeps_axes=arguments.keep_axes,
            progress=progress,
            files=arguments.config,
            texts=arguments.settings,
        )
