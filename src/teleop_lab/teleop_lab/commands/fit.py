"""``teleop fit``: fit numbers of the hardware plant to measured rest positions of a machine."""

import argparse
import json
from pathlib import Path
from typing import Any

from teleop_core.commands.arguments import command, setting_arguments

_EPILOG = """\
without a table those of the RCRT-1's source are taken (ten runs to each of six points), with the
gains that the numbers of the plant `hardware` were fitted with:
  teleop fit                                            half a minute
  teleop fit --free coulomb.theta1 bias.theta1          these alone
  teleop fit rests.csv --robot scara --out scara.yaml   a machine of yours; then
  teleop sim --config scara.yaml --set robot=scara --out bags/predicted
a table is a CSV with a row per run: point, target_<joint> and <joint> of every joint [rad or m].
what can be free: coulomb.<joint>, bias.<joint>, weight.<symbol>; `wander` follows from the spread.
"""


def add(commands: Any) -> None:
    """Add the command's parser."""
    text = "fit friction, bias and weights of the hardware plant to where a machine came to rest"
    parser = command(commands, "fit", _run, text, _EPILOG)
    parser.add_argument("table", nargs="?", type=Path, help="CSV file of rest positions (default: the published ones)")
    parser.add_argument("--robot", default="rcrt1", help="robot of the table (default: rcrt1)")
    parser.add_argument(
        "--free", nargs="+", metavar="NAME", help="parameters to fit (default: all that the table can identify)"
    )
    parser.add_argument(
        "--loss",
        default="cauchy",
        metavar="NAME",
        help="loss function, which limits the weight of outliers: cauchy, huber, soft_l1 or linear",
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all numbers as JSON")
    parser.add_argument(
        "--out", type=Path, metavar="FILE.yaml", help="write the fitted plant as a parameter file, for --config"
    )
    setting_arguments(parser, of_robot=False)  # its robot is that of the table


def _run(arguments: argparse.Namespace) -> int:
    from teleop_core.commands.progress import shown_progress
    from teleop_core.evaluation.command import check_places
    from teleop_lab.fitting import fit_plant

    check_places(arguments.json, arguments.out)
    with shown_progress("fitting") as progress:
        found = fit_plant(
            arguments.table,
            robot=arguments.robot,
            free=arguments.free,
            files=arguments.config,
            texts=arguments.settings,
            loss=arguments.loss,
            progress=lambda share: progress(round(100.0 * share), 100),
        )
    print(found)
    if arguments.json is not None:
        arguments.json.write_text(json.dumps(found.to_json(), indent=1) + "\n", encoding="utf-8")
        print(f"numbers: {arguments.json}")
    if arguments.out is not None:
        arguments.out.write_text(found.parameter_file(), encoding="utf-8")
        print(f"parameters: {arguments.out}; take them with --config {arguments.out}")
    return 0
