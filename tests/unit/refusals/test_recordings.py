"""Recordings and motions of others that cannot be used: refused in one line, and nothing is written."""

import re
import shutil
from operator import attrgetter
from pathlib import Path
from typing import Any, cast

import numpy as np
import pandas as pd
import pytest

import teleop_core as tc
import teleop_exchange
from refused import Case, Step, assert_refused, of
from teleop_core.bags.reader import Bag, recover
from teleop_core.bags.writer import BagWriter
from teleop_core.base import RecordingError, TeleopError
from teleop_core.graph import topics
from teleop_core.session.master_bag import as_master_bag

POSE, STATE, JOINTS = topics.SLAVE_MEASURED_CP, topics.TELEOP_STATE, ("a", "b", "c")


def read_bag(path: Path) -> object:
    return Bag(path).read_many((POSE,))


def bag(change: Step = lambda path: None, count: int = 60) -> Step:
    """A recording of poses, after a change of its folder."""

    def write(path: Path) -> None:
        stamps = np.arange(count)
        with BagWriter(path, topics.ALL, JOINTS) as writer:
            if count:
                writer.write_block({POSE: (stamps, np.ones((count, 7)), stamps)})
        change(path)

    return write


def described(text: str) -> Step:
    return bag(lambda path: (path / "metadata.yaml").write_text(text))


def led_out(place: str) -> Step:
    """Metadata that name a file outside."""

    def change(path: Path) -> None:
        shutil.copy(path / "bag_0.mcap", path.with_name("secret.mcap"))
        index = path / "metadata.yaml"
        index.write_text(index.read_text().replace("- bag_0.mcap", f"- {place.format(path.parent)}"))

    return bag(change)


def cut(share: float) -> Step:
    def write(path: Path) -> None:
        bag()(path.with_name("bag"))
        data = (path.with_name("bag") / "bag_0.mcap").read_bytes()
        path.write_bytes(data[: int(len(data) * share)])

    return write


def recovered(path: Path) -> object:
    return recover(path)


def sqlite(path: Path) -> None:
    path.mkdir()
    (path / "bag_0.db3").write_bytes(b"SQLite format 3\0")


INFORMATION = "rosbag2_bagfile_information"
RECORDINGS = [
    *of(read_bag, "bag",
    (None, "does not exist"), (Path.mkdir, r"no \.mcap file"), (bag(count=0), "holds no messages"),
    (bag(lambda path: (path / "metadata.yaml").unlink()), "teleop recover .*bag"),  # it was not finished
    (sqlite, "must be mcap"),
    *((described(text), words) for text, words in (
        (f"{INFORMATION}: [", "damaged"), ("just text", "damaged"), (f"{INFORMATION}: {{version: 9}}", "damaged"),
        (f"{INFORMATION}: {{relative_file_paths: [gone.mcap]}}", "gone.mcap"),
        (f"{INFORMATION}: {{relative_file_paths: [bag_0.mcap], compression_mode: MESSAGE}}", "by 'message'"))),
    *((led_out(place), "lacks its files") for place in ("../secret.mcap", "{}/secret.mcap", "..", ".")),
    error=RecordingError),
    *of(read_bag, "bag.mcap",
        ("", "empty"), ("#ROSBAG V2.0\n" * 20, "no MCAP file"),
        *((cut(share), "cut off.*teleop recover") for share in (0.01, 0.3, 0.9, 0.9999)), error=RecordingError),
    *of(read_bag, "bag_0.db3", ("SQLite format 3\0" + "\0" * 99, "SQLite"), error=RecordingError),
    *of(recovered, "bag", (None, "does not exist"), (Path.mkdir, r"0 \.mcap files"),
        (bag(count=0), "no complete chunk"), error=RecordingError),
    *of(lambda path: Bag(path).require([topics.SLAVE_SERVO_CP, POSE, "scan"]), "bag",
        (bag(), "lacks slave/servo_cp, scan; it has slave/measured_cp"), error=RecordingError),
    *of(lambda path: Bag(path).reports("slave/measured_cp"), "bag", (bag(), "slave/measured_cp"), error=RecordingError),
    *of(tc.open_recording, "hand.csv", ("t,x,y,z\n0,0,0,0\n", "`teleop import .*hand.csv --out"), error=RecordingError),
    *of(lambda path: tc.configuration(settings={"operator.kind": "bag", "operator.bag": str(path)}), "hand",
        (None, "No such file"), error=RecordingError),
    *of(as_master_bag, "bag", (None, "does not exist"), error=RecordingError),
]  # fmt: skip

# -- motions of others -----------------------------------------------------------------------------

COUNT = 200
Options = dict[str, Any]
T = np.arange(COUNT) * 0.01
GOOD = pd.DataFrame({"t": T, "x": 0.01 * np.sin(T), "y": 0.01 * np.cos(T), "z": 0.0 * T})
QUATERNION = pd.DataFrame({"qw": np.cos(T), "qx": np.sin(T), "qy": 0.0 * T, "qz": 0.0 * T})
MATRIX = pd.DataFrame(np.tile(np.eye(3).reshape(-1), (COUNT, 1)), columns=[f"r{i}{j}" for i in "123" for j in "123"])
BESIDE = pd.concat((GOOD, QUATERNION), axis=1)
BACK, LOST = GOOD.copy(), GOOD.astype(object)
BACK.loc[100, "t"], LOST.loc[150, "y"] = 0.5, "lost"
EULER = ("xyz", "a", "b", "c")


def imports(**options: Any) -> Step:
    return lambda path: teleop_exchange.import_recording(path, path.with_name("out"), **options)


def named(*names: str) -> pd.DataFrame:
    """The motion under other names, and further columns of zeros."""
    table = GOOD.assign(**dict.fromkeys(names[4:], 0.0))
    table.columns = pd.Index(names)
    return table


MOTIONS = [
    *of(imports(), "hand.csv", *((content, re.escape(words)) for content, words in (
        (None, "hand.csv: does not exist"), ("", "is empty"), ("\n \n", "is empty"),
        ("t,x,y,z\n", "contains no rows of numbers"), ("t,x,y,z\n0,1,2,3\n", "a motion needs two"),
        ("a,b\nc,d\ne,f\n", "contains text, not numbers"), (bytes(range(256)), "is no text"),
        (b"\x1f\x8b broken", "cannot be read"), ("PAR1 broken", "no sound Parquet file"),
        (GOOD.assign(y=np.nan), "column y holds no numbers"), (GOOD.assign(t=5.0), "the time is 5 in every row"),
        (GOOD.assign(t=np.nan), "the column of the time contains no numbers"),
        (GOOD.assign(t=np.arange(COUNT) // 3 * 0.01), "does not change in 66.5 % of the rows"),
        (GOOD.assign(t=np.where(np.arange(COUNT) < 100, T, T - 0.5)), "goes back in 49 rows (24.5 %)"))),
        (GOOD[["x", "y", "z"]], "x, y, z.*--rate|--rate.*x, y, z"),
        (GOOD.rename(columns={"x": "a", "y": "b", "z": "c"}), "--position.*t, a, b, c|t, a, b, c.*--position"),
        (LOST, "'y'.*'lost'|'lost'.*'y'"), (pd.concat((GOOD, MATRIX.assign(r33=-1.0)), axis=1), "mirror"),
        *((pd.concat((GOOD, scale * QUATERNION), axis=1), words)
          for scale, words in ((0.0, "no orientation"), (0.5, "unit length"), (2.0, "unit length"))),
        error=TeleopError),
    *(case for options, table, words in cast(list[tuple[Options, Any, str]], [
        ({"position": ("x", "y", "depth")}, GOOD, "--position.*'depth'.*t, x, y, z"),
        ({"backwards": "refuse"}, BACK, "goes back in 1 rows.*--backwards"),
        ({"quaternion": ("t", "qx", "qy", "qz")}, BESIDE, "order"),
        ({"quaternion": ("qx", "qy", "qz", "qw"), "quaternion_order": "wxyz"}, BESIDE, "must be xyzw"),
        ({"position": (2, 3, 5), "time": 1}, GOOD.to_csv(index=False, header=False), "'5'.*1 to 4"),
        ({"unit": "m"}, named("t", "x (mm)", "y (mm)", "z (mm)"), "--unit is 'm', must be mm"),
        ({"time_unit": "s"}, named("t_ms", "x", "y", "z"), "--time-unit is 's', must be ms"),
        ({"angles": "rad"}, named("t", "x", "y", "z", "roll [deg]", "pitch [deg]", "yaw [deg]"),
         "--angles is 'rad', must be deg"),
        ({"unit": "m", "time_unit": "s"}, GOOD.assign(t=T + 1.7e12), "--time-unit"),
        ({"unit": "m", "time_unit": "s"}, GOOD.assign(x=GOOD["x"] + 1.7e12), r"between -1e\+07 and 1e\+07 m"),
        ({"jaw": ("grip", "1")}, GOOD.assign(grip=0.5), "--jaw"),
        *(({"jaw": ("grip", *ends)}, GOOD.assign(grip=0.5), "--jaw")
          for ends in (("1", "1"), ("open", "0"), ("nan", "0"))),
        *((options, GOOD, words) for options, words in (
            *(({"axes": axes}, "mirror") for axes in (("+x", "+y", "-z"), ("+x", "+x", "+z"))),
            ({"axes": ("x", "up", "z")}, "--axes"), ({"unit": "km"}, "one of: m, auto, cm, mm, in"),
            ({"time_unit": "h"}, "one of: auto, s, ms, us, ns"), ({"center": "top"}, "keep"),
            *(({"scale": scale}, "--scale") for scale in (0.0, np.nan)), ({"rate": -1.0}, "--rate"),
            ({"rate": 100.0, "time": "t"}, "--rate"), ({"position": ("x", "y")}, "3 columns"),
            ({"quaternion": ("x", "y", "z")}, "4 columns"),
            *(({"euler": (order, "a", "b", "c")}, "xyz or ZYX") for order in ("xxz", "xYz")),
            ({"matrix": "1-9", "euler": EULER}, "only option"), ({"buttons": "clutch"}, "clutch=0,mode=2"),
            ({"colour": "red"}, "colour"), ({"skip": -1}, "--skip"), ({"topic": "/pose"}, "columns")))])
      for case in of(imports(**options), "hand.csv", (table, words), error=TeleopError)),
]  # fmt: skip


@pytest.mark.parametrize("case", RECORDINGS + MOTIONS, ids=attrgetter("words"))
def test_a_recording_or_a_motion_that_cannot_be_read_is_refused_in_one_line(case: Case, tmp_path: Path) -> None:
    assert_refused(case, tmp_path)
