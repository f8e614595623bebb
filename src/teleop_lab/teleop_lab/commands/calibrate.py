"""``teleop calibrate``: the real geometry of an arm, from measured positions of its tip."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from teleop_core.base.errors import ParameterError, TeleopError
from teleop_core.commands.options import Geometry, Words

if TYPE_CHECKING:
    from teleop_core.robots import Robot
    from teleop_lab.calibration import Calibration

PUBLISHED = "published"


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Simulated:
    """Options of a simulated measurement."""

    poses: int | None = None
    """Number of poses to measure; without it, 40."""
    noise: Annotated[str | None, Parameter(metavar="M|ruler")] = None
    """Standard deviation of a tracker's noise [m], or ruler: a ruler of 0.5 mm; without it, 0.1e-3."""
    errors: Annotated[Words, Parameter(metavar="NAME=VALUE")] = ()
    """Simulated errors of the arm: tolerances cnc (±20 µm) or prototype (±100 µm), and single errors [m, rad] such as
    d3=5.5e-3; without it, cnc, and for the rcrt1 also d3=5.5e-3."""
    choose: str | None = None
    """Choice of the poses: optimal for the identification, as without it, or random."""
    seed: int | None = None
    """Seed of poses, errors and noise; without it, 1."""

    @property
    def given(self) -> dict[str, Any]:
        """Values of the given options."""
        return {name: value for name, value in vars(self).items() if value not in (None, ())}


def calibrate(
    *,
    robot: str = "rcrt1",
    geometry: Geometry = (),
    data: Annotated[str | None, Parameter(metavar="FILE.csv")] = None,
    simulated: Simulated = Simulated(),
    fit: Words = (),
    frame: Literal["known", "unknown"] = "known",
    keep_all: bool = False,
    json: Path | None = None,
    out: Path | None = None,
) -> None:
    """Find joint offsets and link errors of an arm from measured places of its tip.

    Simulated, to see what a measurement would tell before it is made:

        teleop calibrate --poses 40 --noise 0.1e-3  # a tracker of 0.1 mm; the rcrt1 as published
        teleop calibrate --poses 30 --noise ruler   # a ruler of 0.5 mm along x, y and z
        teleop calibrate --robot puma560 --errors prototype theta2=2e-3 --choose random

    From measurements, and back into a session:

        teleop calibrate --data poses.csv --frame unknown --out arm.yaml
        teleop sim --set robot=arm.yaml --out bags/calibrated
        teleop calibrate --data published --fit d3  # tables E.1-E.3 of the rcrt1's source

    poses.csv has a column per joint, named as `teleop robot` shows them or q1, q2 ..., and x, y, z of the tip; metres
    and radians, or as the head says: "theta1_deg", "x [mm]". Errors are called a1, alpha1, d1, theta1 for link 1 and so
    on (standard Denavit-Hartenberg).

    Args:
        robot: Robot whose links form one chain.
        geometry: Lengths and options that replace the published ones [m, rad], such as tip=tool0 of a URDF.
        data: Table of measured poses instead of simulated poses, or 'published'.
        simulated: The simulated measurement.
        fit: Errors to identify: `all` link errors, joint `offsets`, or names such as d3 theta2; without it, all, and
            offsets with a ruler.
        frame: known: x, y, z are in the robot's base frame; unknown: the pose of this frame is identified too.
        keep_all: Also keep errors that do not differ significantly from zero.
        json: Write all numbers as JSON.
        out: Write the identified arm as a table for --set robot=FILE.yaml.
    """
    from teleop_core.evaluation.command import check_places
    from teleop_core.robots import load_robot_set

    check_places(json, out)
    arm = load_robot_set(robot, geometry)
    one = fit[0] if len(fit) == 1 and fit[0] in {"all", "offsets"} else list(fit) or None
    options: dict[str, Any] = {"fit": one, "finds_frame": frame == "unknown", "keeps_all": keep_all}
    found = _simulated(arm, simulated, options) if data is None else _real(arm, data, simulated, options)
    print(found)
    _write(found, json, out)


def _simulated(robot: "Robot", simulated: Simulated, options: dict[str, Any]) -> "Calibration":
    from teleop_lab.calibration import simulate

    given = simulated.given
    if "noise" in given:
        given["noise"] = _noise(given["noise"])
    return simulate(robot, **options, **given)


def _noise(text: str) -> float | str:
    from teleop_lab.calibration.simulate import RULER

    if text == RULER:
        return text
    try:
        return float(text)
    except ValueError:
        raise ParameterError("--noise", text, f"a number [m] or {RULER}") from None


def _real(robot: "Robot", data: str, simulated: Simulated, options: dict[str, Any]) -> "Calibration":
    from teleop_lab.calibration import appendix_e, read_measured
    from teleop_lab.calibration import calibrate as calibrated

    if given := [f"--{name}" for name in simulated.given]:
        raise TeleopError(f"--data gives measured poses; leave out {', '.join(given)}, which are for simulated poses")
    is_published = data == PUBLISHED
    measured = appendix_e.published(robot) if is_published else read_measured(Path(data), robot)
    fit = options.pop("fit") or ("offsets" if is_published else "all")
    return calibrated(robot, measured, fit, **options)


def _write(calibration: "Calibration", json: Path | None, out: Path | None) -> None:
    from json import dumps

    from teleop_lab.calibration.report import correction_file

    if json is not None:
        text = dumps(calibration.to_json(), indent=2, allow_nan=False)
        json.write_text(text + "\n", encoding="utf-8")
        print(f"numbers: {json}")
    if out is not None:
        out.write_text(correction_file(calibration), encoding="utf-8")
        print(f"arm: {out}; take it with --set robot={out}")
