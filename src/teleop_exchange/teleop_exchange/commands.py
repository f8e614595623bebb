"""Commands that exchange recordings with other programs: ``teleop import`` and ``teleop export``."""

import argparse
import re
import shlex
from pathlib import Path
from typing import Any, NoReturn

from teleop_core.base import ParameterError, printable
from teleop_core.commands.arguments import command, out_argument
from teleop_exchange.options import BUTTONS, CHOICES, LENGTHS, ImportOptions

_IMPORT = """\
Make a recording of a hand's motion from a file of others: CSV, TSV or blanks (also .gz), Parquet,
rosbag2 (MCAP, db3), ROS 1 .bag. Columns go by name or, counted from 1, by number; 4-12 stands for
nine of them. What is not said is guessed from the names, and told.
"""
_EXAMPLES = """\
examples:
  teleop import hand.csv --out bags/hand
  teleop import hand.csv --out bags/hand --time t --time-unit ms --position px py pz --unit mm
  teleop import mocap.txt --out bags/mocap --rate 100 --position 1-3 --matrix 4-12
  teleop import tool.csv --out bags/tool --euler ZYX yaw pitch roll --angles deg --axes +y -x +z
  teleop import user.bag --out bags/user --topic /MTMR/measured_cp --buttons clutch=0,mode=2
both hands of one file, with options of each hand beside those of all:
  teleop import two.csv --out bags/two --arm left "--position 2-4" --arm right "--position 5-7"
then:
  teleop replay bags/hand --out bags/hand_replayed
"""


def add_import(commands: Any) -> None:
    """Add ``teleop import``."""
    text = "turn a file from another system into a recording"
    parser = command(commands, "import", _import, text, _EXAMPLES)
    parser.description = _IMPORT
    parser.add_argument("file", type=Path, metavar="FILE", help="file or directory to import")
    out_argument(parser)
    parser.add_argument(
        "--arm",
        nargs=2,
        action="append",
        default=[],
        metavar=("NAME", "OPTIONS"),
        help="one of several arms in the file, with its own import options",
    )
    _options(parser)


def _options(parser: argparse.ArgumentParser) -> None:
    # In `--axes +y -x +z`, -x is a value, but argparse accepts a leading minus only in numbers; this pattern allows
    # axes.
    parser._negative_number_matcher = re.compile(r"-([xyz]|\d+|\d*\.\d+)$")
    _time(parser.add_argument_group("time"))
    _place(parser.add_argument_group("position and orientation"))
    _buttons(parser.add_argument_group("buttons"))
    _changes(parser.add_argument_group("axes and place"))
    _damage(parser.add_argument_group("what is damaged"))
    bags = parser.add_argument_group("recordings of ROS")
    bags.add_argument("--topic", metavar="TOPIC", help="topic of the poses; needed if the file has several")
    bags.add_argument("--frame", metavar="NAME", help="child frame; needed if the topic has several")
    bags.add_argument("--parent", metavar="NAME", help="parent frame of the poses; needed if the file has several")
    bags.add_argument(
        "--stamps",
        choices=("header", "log"),
        help="timestamps to use: those of the headers (default), or the log times",
    )


def _time(group: Any) -> None:
    group.add_argument(
        "--time", nargs="+", metavar="COL", help="column of the time, or the two columns of seconds and nanoseconds"
    )
    group.add_argument("--rate", type=float, metavar="HZ", help="samples per second, for a file without times")
    group.add_argument(
        "--time-unit",
        choices=CHOICES["time_unit"],
        help="unit of the time (default: guessed); dotnet and filetime: 100 ns since the years 1 and 1601; excel and "
        "matlab: days since 1900 and the year 0",
    )


def _place(group: Any) -> None:
    group.add_argument("--position", nargs="+", metavar="COL", help="columns of x, y, z")
    group.add_argument(
        "--unit", choices=("auto", *LENGTHS), help="unit of the position (default: by the column names, else m)"
    )
    group.add_argument("--quaternion", nargs="+", metavar="COL", help="four columns")
    group.add_argument(
        "--quaternion-order",
        choices=("auto", "wxyz", "xyzw"),
        help="order of the quaternion's columns (default: by their names, else wxyz)",
    )
    group.add_argument("--matrix", nargs="+", metavar="COL", help="nine columns of a rotation matrix")
    group.add_argument(
        "--matrix-order",
        choices=("row", "column"),
        help="order of the columns of --rotation-matrix: row by row (default) or column by column",
    )
    group.add_argument(
        "--euler",
        nargs="+",
        metavar="COL",
        help="order of the axes and three columns: xyz about fixed axes, XYZ about axes that turn with the body",
    )
    group.add_argument("--rotation-vector", nargs="+", metavar="COL", help="three columns")
    group.add_argument("--angles", choices=("auto", "rad", "deg"), help="unit of --euler and --rotation-vector")
    group.add_argument(
        "--orientation",
        choices=("auto", "none"),
        help="none: the orientation is constant, and no columns are guessed for it",
    )


def _buttons(group: Any) -> None:
    for button in BUTTONS:
        group.add_argument(f"--{button}", metavar="COL", help=f"column of the {button} button")
    group.add_argument(
        "--threshold", type=float, metavar="X", help="a button is pressed above this value (default: 0.5)"
    )
    group.add_argument(
        "--jaw",
        nargs=3,
        metavar=("COL", "OPEN", "CLOSED"),
        help="column of a jaw or gripper, and its values when open and when closed",
    )
    group.add_argument("--buttons-topic", metavar="TOPIC", help="topic of Joy messages in a bag")
    group.add_argument(
        "--buttons", metavar="MAP", help="indices of buttons in the Joy, such as clutch=0,mode=2; or none"
    )


def _changes(group: Any) -> None:
    group.add_argument(
        "--axes",
        nargs=3,
        metavar=("X", "Y", "Z"),
        help="axes of the file along x, y, z of the master, such as +y -x +z",
    )
    group.add_argument(
        "--handedness",
        choices=("right", "left"),
        help="handedness of the file's axes: right (default), or left as in game engines, for which --axes must mirror",
    )
    group.add_argument("--scale", type=float, metavar="X", help="factor for all positions (default: 1)")
    group.add_argument(
        "--center",
        choices=("keep", "mean", "middle", "start"),
        help="point of the motion that becomes the origin: mean, middle of the range, or start "
        "(default: keep the file's origin)",
    )


def _damage(group: Any) -> None:
    group.add_argument("--skip", type=int, metavar="N", help="number of lines to skip at the beginning")
    group.add_argument(
        "--episode",
        type=_episode,
        metavar="N|all",
        help="number of the episode, if the file contains several; all: import each into a directory "
        "of recordings, also for the directory of a LeRobot data set",
    )
    group.add_argument(
        "--numbered-by",
        nargs="+",
        metavar="COL",
        help="columns that number the episodes; combinations of several are numbered from 0 in the order of the file "
        "(default: the column called episode_index or the like); none: the file is one recording",
    )
    group.add_argument(
        "--backwards",
        choices=("auto", "refuse", "drop", "sort"),
        help="treatment of rows whose time goes back (default: drop them if they are at most 1 %%, "
        "else refuse the file)",
    )
    group.add_argument("--gap", type=float, metavar="N", help="report gaps longer than N periods (default: 5)")


_EXPORT = """\
Write a recording as CSV or Parquet, with a column for each number of each topic over the time, or
recordings as a LeRobot data set (version 3.0 of its format, no pictures) with an episode each.
"""
_EXPORT_EXAMPLES = """\
examples:
  teleop export bags/coarse --out coarse.csv
  teleop export bags/coarse --out tip.parquet --topics slave/measured_cp slave/servo_cp
  teleop export bags/coarse --out coarse_100hz.csv --rate 100 --units
  teleop export bags/a bags/b --out dataset --format lerobot --task "follow the edge"
"""


def add_export(commands: Any) -> None:
    """Add ``teleop export``."""
    text = "write recordings as tables or a data set"
    parser = command(commands, "export", _export, text, _EXPORT_EXAMPLES)
    parser.description = _EXPORT
    parser.add_argument("bags", type=Path, nargs="+", metavar="BAG", help="recordings to export")
    parser.add_argument(
        "--out",
        type=Path,
        required=True,
        metavar="X",
        help="new file (.csv, .csv.gz or .parquet), or new directory without an ending for a data set",
    )
    parser.add_argument(
        "--format", choices=("csv", "parquet", "lerobot"), help="format (default: by the ending of --out)"
    )
    parser.add_argument("--topics", nargs="+", default=(), metavar="TOPIC", help="only these")
    parser.add_argument(
        "--rate",
        type=float,
        metavar="HZ",
        help="rows per second, each with the newest values (default: a row per message; lerobot: 50)",
    )
    parser.add_argument("--units", action="store_true", help="add the unit to the name of each column: 'tip.x [m]'")
    parser.add_argument(
        "--action",
        choices=("joints", "tip"),
        default="joints",
        help="lerobot: topic of the actions, slave/servo_jp (default) or slave/servo_cp",
    )
    parser.add_argument("--task", default="teleoperation", metavar="TEXT", help="lerobot: description of the task")


def _export(arguments: argparse.Namespace) -> int:
    from teleop_exchange import export_recording

    report = export_recording(
        arguments.bags,
        arguments.out,
        arguments.format,
        topics=arguments.topics,
        rate=arguments.rate,
        units=arguments.units,
        action=arguments.action,
        task=arguments.task,
    )
    print(printable(str(report)))
    return 0


def _episode(text: str) -> int | str:
    if text != "all" and not text.isdigit():
        raise argparse.ArgumentTypeError(f"{text!r} must be a number, or all")
    return text if text == "all" else int(text)


def _import(arguments: argparse.Namespace) -> int:
    from teleop_exchange import import_episodes, import_recording

    arms = {name: _given(_of_arm(name, text)) for name, text in arguments.arm}
    if arguments.episode == "all":
        arguments.episode = None
        episodes = import_episodes(
            arguments.file,
            arguments.out,
            arms=arms,
            say=lambda line: print(printable(line), flush=True),
            **_given(arguments),
        )
        print(printable(str(episodes)))
        return 2 if episodes.refused else 0
    report = import_recording(arguments.file, arguments.out, arms=arms, **_given(arguments))
    print(printable(str(report)))
    print(
        f"{arguments.out}: {report.duration:.1f} s imported; next: "
        f"teleop replay {arguments.out} --out {arguments.out}_replayed"
    )
    return 0


class _OfArm(argparse.ArgumentParser):
    """Parser of the options of one hand."""

    def error(self, message: str) -> NoReturn:
        raise ParameterError("--arm", self.prog, f"options of the import; {message}")


def _of_arm(name: str, text: str) -> argparse.Namespace:
    parser = _OfArm(prog=name, add_help=False)
    _options(parser)
    try:
        words = shlex.split(text)
    except ValueError as error:
        raise ParameterError("--arm", text, f"options of the import ({error})") from error
    return parser.parse_args(words)


def _given(arguments: argparse.Namespace) -> dict[str, Any]:
    given = vars(arguments)
    names = ImportOptions.__dataclass_fields__
    return {name: given[name] for name in names if given.get(name) is not None}
