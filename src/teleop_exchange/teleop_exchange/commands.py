"""Commands that exchange recordings with other programs: ``teleop import`` and ``teleop export``."""

import shlex
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import App, CycloptsError, Parameter

from teleop_core.base import ParameterError, printable
from teleop_core.commands.options import Words
from teleop_exchange.options import ImportOptions

Format = Literal["csv", "parquet", "lerobot"]
Arms = Annotated[
    tuple[tuple[str, str], ...], Parameter(consume_multiple=False, allow_leading_hyphen=True, metavar="NAME OPTIONS")
]


def import_(
    file: Path,
    /,
    *,
    out: Path,
    arm: Arms = (),
    options: Annotated[ImportOptions, Parameter(name="*")] = ImportOptions(),
) -> int:
    """Turn a file from another system into a recording.

    Makes a recording of a hand's motion from a file of others: CSV, TSV or blanks (also .gz), Parquet, rosbag2 (MCAP,
    db3), ROS 1 .bag. Columns go by name or, counted from 1, by number; 4-12 stands for nine of them. What is not said
    is guessed from the names, and told.

    For example:

        teleop import hand.csv --out bags/hand
        teleop import hand.csv --out bags/hand --time t --time-unit ms --position px py pz --unit mm
        teleop import mocap.txt --out bags/mocap --rate 100 --position 1-3 --matrix 4-12
        teleop import tool.csv --out bags/tool --euler ZYX yaw pitch roll --angles deg --axes +y -x +z
        teleop import user.bag --out bags/user --topic /MTMR/measured_cp --buttons clutch=0,mode=2

    Both hands of one file, with options of each hand beside those of all:

        teleop import two.csv --out bags/two --arm left "--position 2-4" --arm right "--position 5-7"

    Then:

        teleop replay bags/hand --out bags/hand_replayed

    Args:
        file: File or directory to import.
        out: Directory for the recording; it must not exist yet.
        arm: One of several arms in the file, with its own import options; may be repeated.
        options: What is read from the file, and how it is converted.
    """
    from teleop_exchange import import_episodes, import_recording

    arms = {name: of_arm(name, text) for name, text in arm}
    if options.episode == "all":
        episodes = import_episodes(file, out, options, arms=arms, say=lambda line: print(printable(line), flush=True))
        print(printable(str(episodes)))
        return 2 if episodes.refused else 0
    report = import_recording(file, out, options, arms=arms)
    print(printable(str(report)))
    print(f"{out}: {report.duration:.1f} s imported; next: teleop replay {out} --out {out}_replayed")
    return 0


def of_arm(name: str, text: str) -> dict[str, Any]:
    """Import options that a text gives for one arm.

    Raises:
        ParameterError: The text is wrong.
    """
    app = App(name=name, help_flags=(), version_flags=(), default_parameter=Parameter(negative=(), consume_multiple=1))

    @app.default
    def options_of(*, options: Annotated[ImportOptions, Parameter(name="*")] = ImportOptions()) -> ImportOptions:
        return options

    try:
        words = shlex.split(text)
        options = app(words, exit_on_error=False, print_error=False, result_action="return_value")
    except (ValueError, CycloptsError) as error:
        if isinstance(error, CycloptsError):
            error.verbose = False
        raise ParameterError("--arm", f"{name} {text}", f"options of the import; {error}") from error
    given = {word.partition("=")[0] for word in words}
    return {one: value for one, value in vars(options).items() if f"--{one.replace('_', '-')}" in given}


def export(
    bags: tuple[Path, ...],
    /,
    *,
    out: Path | None = None,
    to: tuple[Format, Path] | None = None,
    format_: Annotated[Format | None, Parameter(name="--format")] = None,
    topics: Words = (),
    rate: float | None = None,
    units: bool = False,
    state: Words = (),
    action: Words = ("joints",),
    cameras: Words = (),
    video: Literal["av1", "h264"] = "av1",
    task: str = "teleoperation",
) -> None:
    """Write recordings as tables or a data set.

    Writes a recording as CSV or Parquet, with a column for each number of each topic over the time. Or writes
    recordings as a LeRobot data set (version 3.0 of its format) with an episode each, and a video of each camera.

    For example:

        teleop export bags/coarse --out coarse.csv
        teleop export bags/coarse --out tip.parquet --topics slave/measured_cp slave/servo_cp
        teleop export bags/coarse --out coarse_100hz.csv --rate 100 --units
        teleop export bags/a bags/b --to lerobot dataset --task "follow the edge"
        teleop export drive.db3 --to lerobot drive --state joint_states --action cmd_vel --cameras front/image_raw

    Args:
        bags: Recordings to export; for a data set also those of other writers (rosbag2 as MCAP or db3, ROS 1 .bag).
        out: New file (.csv, .csv.gz or .parquet), or new directory without an ending for a data set.
        to: Format and output in one: 'lerobot dataset' is '--format lerobot --out dataset'.
        format_: Format; without it, by the ending of --out.
        topics: Only these topics.
        rate: Rows per second [Hz], each with the newest values; without it, a row per message. For lerobot a whole
            number; without it, the rate of the fastest camera, or 50 Hz without cameras.
        units: Add the unit to the name of each column: 'tip.x [m]'.
        state: Of lerobot: topics of observation.state; without it, the slave's joints and tip.
        action: Of lerobot: joints (slave/servo_jp), tip (slave/servo_cp), or topics of the action.
        cameras: Of lerobot: topics of pictures; without it all of them, 'none' for none.
        video: Of lerobot: codec of the videos. h264 is made four times as fast as av1, and its files are larger.
        task: Of lerobot: description of the task.
    """
    from teleop_exchange import export_recording

    if (out is None) == (to is None):
        raise ParameterError("--out", out, "given, or --to FORMAT OUT, not both")
    if to is not None:
        format_, out = to
    assert out is not None
    seen = None if not cameras else () if tuple(cameras) == ("none",) else cameras
    report = export_recording(
        list(bags), out, format_,
        topics=topics, rate=rate, units=units, state=state, action=action, cameras=seen, video=video, task=task,
    )  # fmt: skip
    print(printable(str(report)))
