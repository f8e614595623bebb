"""Every command that opens a file, on broken ones: it works, or refuses in one line with code 2.

Commands run in this process, by the function that ``teleop`` calls, with arguments as typed. Three
of them do more than open their file, for minutes or for as long as somebody looks: of ``fit``,
``console`` and ``play`` what reads the file is called alone.
"""

import io
import shutil
import warnings
from collections.abc import Iterator
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import strategies as st
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionMode, StoragePlugin

import teleop_core as tc
from foreign_bags import Maker, write1, write2
from fuzzing import NASTY, assert_one_line, damaged, fuzz
from teleop_console.recorded import RecordedLink
from teleop_core.bags.reader import Bag
from teleop_core.commands import cli
from teleop_core.graph.layers import config_folder
from teleop_core.robots import load_robot
from teleop_lab.fitting.rest_table import read_rests

pytestmark = pytest.mark.slow
REFUSED = 2
NAMES = (b"geometry_msgs/msg/PoseStamped", b"sensor_msgs/msg/Joy", b"sensor_msgs/msg/JointState",
         b"geometry_msgs/msg/WrenchStamped", b"diagnostic_msgs/msg/DiagnosticArray",
         b"geometry_msgs/PoseStamped", b"sensor_msgs/Joy", b"tf2_msgs/msg/TFMessage",
         b"std_msgs/msg/Header", b"float64", b"uint32", b"string")  # fmt: skip


def teleop(*arguments: object) -> int:
    """Exit code of a command; what it says on stderr are notes, and one line if it refuses."""
    out, said = io.StringIO(), io.StringIO()
    with redirect_stdout(out), redirect_stderr(said), warnings.catch_warnings():
        warnings.simplefilter("always")
        code = cli.main([str(argument) for argument in arguments])
    lines = [line for line in said.getvalue().splitlines() if not line.startswith("note: ")]
    if code == REFUSED:
        assert len(lines) == 1, said.getvalue()
        assert_one_line(lines[0].partition(": ")[2])
    else:
        assert code == 0, (code, said.getvalue())
    return code


@st.composite
def broken(draw: st.DrawFn, whole: bytes) -> bytes:
    """Bytes that are damaged, or say that they are of another type, or are nearly nothing."""
    kind = draw(st.integers(0, 9))
    if kind == 0:
        here = [name for name in NAMES if name in whole] or [whole[:4]]
        old, new = draw(st.sampled_from(here)), draw(st.sampled_from(NAMES))
        return whole.replace(old, new, draw(st.integers(1, 3)))
    if kind == 1:
        return draw(st.sampled_from((b"", whole[:8], whole[:50], b"\0" * 300, *map(_bytes, NASTY))))
    return draw(damaged(whole))


def _bytes(text: str) -> bytes:
    return text.encode("utf-8", "surrogatepass")


# -- sound files ---------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("commands")


@pytest.fixture(scope="module")
def session(folder: Path) -> bytes:
    """A recording of ours, of 60 ms."""
    path = folder / "whole"
    tc.run("coarse_box", duration=0.06, out=path, settings={"recorder.compression": "none", "recorder.tf_rate": 0.0})
    return (path / "whole_0.mcap").read_bytes()


COUNT = 12
STAMPS = 1_700_000_000_000_000_000 + 10_000_000 * np.arange(COUNT)
PLACES = 0.01 * np.column_stack([np.sin(np.arange(COUNT) + k) for k in range(3)])


def hand() -> pd.DataFrame:
    table = pd.DataFrame(PLACES, columns=["x", "y", "z"])
    table.insert(0, "t", 0.01 * np.arange(COUNT))
    for name, value in zip(("qw", "qx", "qy", "qz"), (1.0, 0.0, 0.0, 0.0), strict=True):
        table[name] = value
    table["clutch"] = np.arange(COUNT) % 3 == 0
    return table


def messages(is_ros2: bool) -> Iterator[tuple[str, int, Any]]:
    """Poses and buttons, as the types of a version of ROS."""
    maker = Maker(is_ros2)
    for stamp, place in zip(STAMPS.tolist(), PLACES, strict=True):
        yield "/hand", stamp, maker.pose([*place, 1.0, 0.0, 0.0, 0.0], "PoseStamped", stamp)
        yield "/joy", stamp, maker.joy(stamp, [0, 1])


def bag1(path: Path, packing: Writer1.CompressionFormat | None = None) -> bytes:
    return write1(path, messages(False), packing).read_bytes()


def bag2(path: Path, storage: StoragePlugin, mode: Any = None) -> bytes:
    write2(path, messages(True), storage, mode)
    return next(file for file in path.iterdir() if file.suffix != ".yaml").read_bytes()


# -- recordings of ours --------------------------------------------------------------------------

READERS = {
    "evaluate": lambda file, out: teleop("evaluate", file, "--json", f"{out}.json"),
    "recover": lambda file, out: teleop("recover", file, "--out", out),
    "replay": lambda file, out: teleop("replay", file, "--out", out),
    "reach": lambda file, out: teleop("reach", file, "--share", "1", "--out", f"{out}.yaml"),
    "export": lambda file, out: teleop("export", file, "--out", f"{out}.csv"),
    "import": lambda file, out: teleop("import", file, "--out", out),
    "console": lambda file, _: RecordedLink(file).view(0.03),
    "play": lambda file, _: all(Bag(file).raw()),
}


@pytest.mark.parametrize("command", READERS)
def test_any_recording_is_taken_or_refused(folder: Path, session: bytes, command: str) -> None:
    file, out = folder / "broken.mcap", folder / command
    run = READERS[command]

    def attempt(data: bytes) -> None:
        file.write_bytes(data)
        shutil.rmtree(out, ignore_errors=True)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            run(file, out)

    attempt(session)
    fuzz(f"command {command}", data=broken(session))(attempt)()


# -- files of others -----------------------------------------------------------------------------

MAKERS = {
    "hand.csv": lambda path: hand().to_csv(path, index=False) or path.read_bytes(),
    "hand.tsv": lambda path: hand().to_csv(path, index=False, sep="\t") or path.read_bytes(),
    "hand.txt": lambda path: hand().to_csv(path, index=False, sep=" ") or path.read_bytes(),
    "hand.csv.gz": lambda path: hand().to_csv(path, index=False) or path.read_bytes(),
    "hand.parquet": lambda path: hand().to_parquet(path) or path.read_bytes(),
    "plain.bag": bag1,
    "bz2.bag": lambda path: bag1(path, Writer1.CompressionFormat.BZ2),
    "lz4.bag": lambda path: bag1(path, Writer1.CompressionFormat.LZ4),
    "foreign.mcap": lambda path: bag2(path.with_name("mcap"), StoragePlugin.MCAP),
    "foreign.db3": lambda path: bag2(path.with_name("db3"), StoragePlugin.SQLITE3),
}


@pytest.mark.parametrize("name", MAKERS)
def test_any_file_of_others_is_imported_or_refused(folder: Path, name: str) -> None:
    whole, out = MAKERS[name](folder / name), folder / f"{name}_imported"
    broken_file = folder / f"broken_{name}"

    def attempt(data: bytes) -> int:
        broken_file.write_bytes(data)
        shutil.rmtree(out, ignore_errors=True)
        return teleop("import", broken_file, "--out", out)

    assert attempt(whole) == 0
    fuzz("imports", len(MAKERS) + 2, data=broken(whole))(lambda data: attempt(data) and None)()


@pytest.mark.parametrize("mode", [CompressionMode.FILE, CompressionMode.MESSAGE])
def test_any_compressed_recording_is_imported_or_refused(folder: Path, mode: Any) -> None:
    path, out = folder / f"packed_{mode.name}", folder / "unpacked"
    whole = bag2(path, StoragePlugin.MCAP, mode)
    file = next(file for file in path.iterdir() if file.suffix != ".yaml")

    def attempt(data: bytes) -> int:
        file.write_bytes(data)
        shutil.rmtree(out, ignore_errors=True)
        return teleop("import", path, "--out", out)

    assert attempt(whole) == 0
    fuzz("imports", len(MAKERS) + 2, data=broken(whole))(lambda data: attempt(data) and None)()


# -- tables --------------------------------------------------------------------------------------


def poses_table(robot: tc.Robot) -> bytes:
    """Tip positions at random joints."""
    joints = np.random.default_rng(1).uniform(-0.3, 0.3, (8, robot.n)) + robot.start
    joints = np.clip(joints, robot.lower, robot.upper)
    tips = np.array([robot.fk(q)[:3, 3] for q in joints])
    table = pd.DataFrame(np.hstack((joints, tips)), columns=[*robot.joint_names, "x", "y", "z"])
    return table.to_csv(index=False).encode()


def rests_table(robot: tc.Robot) -> bytes:
    rng = np.random.default_rng(2)
    targets = np.repeat([robot.start, robot.home], 3, axis=0)
    columns = [*(f"target_{name}" for name in robot.joint_names), *robot.joint_names]
    rows = np.hstack((targets, targets + rng.normal(0.0, 1e-3, targets.shape)))
    table = pd.DataFrame(rows, columns=columns)
    table.insert(0, "point", np.repeat([1, 2], 3))
    return table.to_csv(index=False).encode()


def test_any_table_of_measured_poses_is_taken_or_refused(folder: Path) -> None:
    file, whole = folder / "poses.csv", poses_table(load_robot("rcrt1"))

    def attempt(data: bytes) -> None:
        file.write_bytes(data)
        teleop("calibrate", "--data", file, "--fit", "offsets")

    attempt(whole)
    fuzz("command calibrate", data=broken(whole))(attempt)()


def test_any_table_of_rests_is_taken_or_refused(folder: Path) -> None:
    robot = load_robot("rcrt1")
    file, whole = folder / "rests.csv", rests_table(robot)

    def attempt(data: bytes) -> None:
        file.write_bytes(data)
        read_rests(file, robot)

    attempt(whole)
    fuzz("table of rests", data=broken(whole))(attempt)()


def test_any_table_of_a_robot_is_taken_or_refused(folder: Path) -> None:
    file = folder / "robot.yaml"
    tables = [path.read_bytes() for path in sorted((config_folder() / "robots").glob("*.yaml"))]
    entries = st.sampled_from(
        ("q + .", "q - 90", "q + e", "q+1e999", "-q - 1.e+2", "q + 1..2", "q +", "q + ٣", "qq", ".")
    )

    @st.composite
    def texts(draw: st.DrawFn) -> bytes:
        whole = draw(st.sampled_from(tables))
        if draw(st.booleans()):
            return whole.replace(b"q", _bytes(draw(entries)), draw(st.integers(1, 4)))
        return draw(broken(whole))

    def attempt(data: bytes) -> None:
        file.write_bytes(data)
        teleop("robot", "--from", file)

    fuzz("robot tables", data=texts())(attempt)()
