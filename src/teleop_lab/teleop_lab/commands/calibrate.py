"""``teleop calibrate``: the real geometry of an arm, from measured positions of its tip."""

import argparse
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from teleop_core.base.errors import ParameterError, TeleopError
from teleop_core.commands.arguments import command, geometry_argument

if TYPE_CHECKING:
    from teleop_core.robots import Robot
    from teleop_lab.calibration import Calibration

PUBLISHED = "published"
_EPILOG = """\
simulated, to see what a measurement would tell before it is made:
  teleop calibrate --poses 40 --noise 0.1e-3            a tracker of 0.1 mm; the rcrt1 as published
  teleop calibrate --poses 30 --noise ruler             a ruler of 0.5 mm along x, y and z
  teleop calibrate --robot puma560 --errors prototype theta2=2e-3 --choose random
from measurements, and back into a session:
  teleop calibrate --data poses.csv --frame unknown --out arm.yaml
  teleop sim --set robot=arm.yaml --out bags/calibrated
  teleop calibrate --data published --fit d3            tables E.1-E.3 of the rcrt1's source
poses.csv has a column per joint, named as `teleop robot` shows them or q1, q2 ..., and x, y, z of
the tip; metres and radians, or as the head says: "theta1_deg", "x [mm]".
errors are called a1, alpha1, d1, theta1 for link 1 and so on (standard Denavit-Hartenberg).
"""
_OF_SIMULATION = ("poses", "noise", "errors", "choose", "seed")


def add(commands: Any) -> None:
    """Add the command's parser."""
    text = "find joint offsets and link errors of an arm from measured places of its tip"
    parser = command(commands, "calibrate", _run, text, _EPILOG)
    parser.add_argument("--robot", default="rcrt1", help="robot whose links form one chain (default: rcrt1)")
    geometry_argument(parser)
    parser.add_argument(
        "--data", metavar="FILE.csv", help=f"table of measured poses instead of simulated poses, or {PUBLISHED!r}"
    )
    _add_simulation(parser)
    parser.add_argument(
        "--fit",
        nargs="+",
        metavar="NAME",
        help="errors to identify: `all` link errors, joint `offsets`, or names such as d3 theta2 "
        "(default: all; with a ruler: offsets)",
    )
    parser.add_argument(
        "--frame",
        choices=("known", "unknown"),
        default="known",
        help="known: x, y, z are in the robot's base frame; unknown: the pose of this frame is identified too",
    )
    parser.add_argument(
        "--keep-all", action="store_true", help="also keep errors that do not differ significantly from zero"
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all numbers as JSON")
    parser.add_argument(
        "--out", type=Path, metavar="FILE.yaml", help="write the identified arm as a table for --set robot=FILE.yaml"
    )


def _add_simulation(parser: argparse.ArgumentParser) -> None:
    """Add the options of a simulated measurement; an option that is not given is None."""
    parser.add_argument("--poses", type=int, metavar="N", help="number of poses to measure (default: 40)")
    parser.add_argument(
        "--noise",
        metavar="M|ruler",
        help="standard deviation of a tracker's noise [m] (default: 0.1e-3), or ruler: a ruler of 0.5 mm",
    )
    parser.add_argument(
        "--errors",
        nargs="+",
        metavar="NAME=VALUE",
        help="simulated errors of the arm: tolerances cnc (±20 µm) or prototype (±100 µm), and single "
        "errors [m, rad] such as d3=5.5e-3 (default: cnc; for the rcrt1 with d3=5.5e-3)",
    )
    parser.add_argument(
        "--choose",
        metavar="optimal|random",
        help="choice of the poses: optimal for the identification (default), or random",
    )
    parser.add_argument("--seed", type=int, metavar="N", help="seed of poses, errors and noise (default: 1)")


def _run(arguments: argparse.Namespace) -> int:
    from teleop_core.evaluation.command import check_places
    from teleop_core.robots import load_robot_set

    check_places(arguments.json, arguments.out)
    robot = load_robot_set(arguments.robot, arguments.geometry)
    calibration = _simulated(robot, arguments) if arguments.data is None else _real(robot, arguments)
    print(calibration)
    _write(calibration, arguments)
    return 0


def _fit(arguments: argparse.Namespace) -> str | list[str] | None:
    given: list[str] | None = arguments.fit
    if given is not None and len(given) == 1 and given[0] in ("all", "offsets"):
        return given[0]
    return given


def _simulated(robot: "Robot", arguments: argparse.Namespace) -> "Calibration":
    from teleop_lab.calibration import simulate

    given = {name: getattr(arguments, name) for name in _OF_SIMULATION}
    options = {name: value for name, value in given.items() if value is not None}
    if "noise" in options:
        options["noise"] = _noise(options["noise"])
    return simulate(
        robot, fit=_fit(arguments), finds_frame=arguments.frame == "unknown", keeps_all=arguments.keep_all, **options
    )


def _noise(text: str) -> float | str:
    from teleop_lab.calibration.simulate import RULER

    if text == RULER:
        return text
    try:
        return float(text)
    except ValueError:
        raise ParameterError("--noise", text, f"a number [m] or {RULER}") from None


def _real(robot: "Robot", arguments: argparse.Namespace) -> "Calibration":
    from teleop_lab.calibration import appendix_e, calibrate, read_measured

    given = [f"--{name}" for name in _OF_SIMULATION if getattr(arguments, name) is not None]
    if given:
        raise TeleopError(f"--data gives measured poses; leave out {', '.join(given)}, which are for simulated poses")
    is_published = arguments.data == PUBLISHED
    measured = appendix_e.published(robot) if is_published else read_measured(Path(arguments.data), robot)
    fit = _fit(arguments) or ("offsets" if is_published else "all")
    return calibrate(robot, measured, fit, finds_frame=arguments.frame == "unknown", keeps_all=arguments.keep_all)


def _write(calibration: "Calibration", arguments: argparse.Namespace) -> None:
    from teleop_lab.calibration.report import correction_file

    if arguments.json is not None:
        text = json.dumps(calibration.to_json(), indent=2, allow_nan=False)
        arguments.json.write_text(text + "\n", encoding="utf-8")
        print(f"numbers: {arguments.json}")
    if arguments.out is not None:
        arguments.out.write_text(correction_file(calibration), encoding="utf-8")
        print(f"arm: {arguments.out}; take it with --set robot={arguments.out}")
