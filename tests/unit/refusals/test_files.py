"""Files of settings, numbers and shapes that cannot be used: refused in one line, and nothing is written."""

from collections.abc import Callable
from operator import attrgetter
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import trimesh

from refused import Case, Step, assert_refused, of
from teleop_core.base import RecordingError, TeleopError, UnknownNameError
from teleop_core.base.plain_yaml import LARGEST_TEXT
from teleop_core.coupling.network.trace import read_trace
from teleop_core.graph import layers
from teleop_core.nodes.files import checked_arguments
from teleop_core.robots import load_robot
from teleop_core.robots.arms.dh import load_table
from teleop_core.session.configuration import configure
from teleop_core.session.virtual import VirtualTime
from teleop_core.shapes.height_field import HEIGHT_FIELD, HeightFieldParameters
from teleop_lab import read_study, read_tuning
from teleop_lab.calibration.measured import CalibrationError, read_measured
from teleop_lab.fitting.rest_table import PUBLISHED, read_rests
from teleop_lab.people.plan import read_plan

ROOT = Path(__file__).resolve().parents[3]
RCRT1 = load_robot("rcrt1")
PEOPLE = (ROOT / "config/studies/people_on_a_late_screen.yaml").read_text()

# -- YAML ------------------------------------------------------------------------------------------

BOMB = "\n".join(f"{own}: &{own} [{', '.join([inner] * 99)}]" for own, inner in (("a", "1"), ("b", "*a"), ("c", "*b")))


def of_node(path: Path) -> object:
    return checked_arguments(["--params-file", str(path)])


def people(line: str) -> str:
    """The study of the repository with another line about its people."""
    before, _, kept = PEOPLE.partition("people:\n")
    key = line.partition(":")[0]
    rest = [old for old in kept.splitlines() if not old.strip().startswith(f"{key}:")]
    return "\n".join([before + "people:", f"  {line}", *rest])


CONFIGURATIONS = [
    *of(layers.load_file, "mine.yaml",
        (None, "mine.yaml: cannot be read"), ("", "mine.yaml.*stages"), ("[1, 2]", "mine.yaml.*stages"),
        ("slave_sim: 3", "mine.yaml.*ros__parameters"), ("slave_sim: {robot: rcrt1}", "mine.yaml.*ros__parameters"),
        ("slaves: {ros__parameters: {}}", "slave_sim"), ("a: [", "mine.yaml.*YAML"),
        ("a: 1\nslave:\n  x: 1\n  y: 2\n  x: 3\n", "mine.yaml.*the key 'x' twice, in lines 3 and 5"),
        ("slave: {}\nteleop: {}\nslave: {}\n", "mine.yaml.*the key 'slave' twice, in lines 1 and 3"),
        ("{true: 1, yes: 2}", "mine.yaml.*the key 'yes' twice, in lines 1 and 1"),
        ("slave: {ros__parameters: {robot: mma}}\n/slave: {ros__parameters: {robot: rcrt1}}",
         "mine.yaml.*slave.robot .*/slave;"),
        ("slave: {ros__parameters: {operation.heartbeat: 0.1, operation: {heartbeat: 1.0}}}",
         "mine.yaml.*slave.operation.heart"), error=TeleopError),
    *of(lambda path: configure(files=[path]), "mine.yaml",
        ("slave: {ros__parameters: {speed: 1.0}}", "of slave is 'speed', must be one of: start_speed"),
        ("'/**': {ros__parameters: {robto: mma}}", r"/\*\* is 'robto'.*robot"), error=UnknownNameError),
    *of(lambda path: configure(files=[path]), "mine.yaml",
        ("impedance: {ros__parameters: {force_gain: 2.0}}", "impedance.force_gain is 2.0, must be left out")),
    *of(of_node, "mine.yaml",
        ("a: " + "x" * LARGEST_TEXT, "has more than"), ("[", "is not YAML"), (BOMB, "values"),
        ("[" * 2000 + "]" * 2000, "nested too deeply"), ("- " * 2000, "nested too deeply"), error=TeleopError),
    *of(read_tuning, "tune.yaml",
        ("tune: {coarse_gain: 1.0}\nminimize: task.time_s", "a list of choices, or"),
        ("tune: {coarse_gain: {low: 0.1}}\nminimize: task.time_s", "a list of choices, or"),
        ("tune: {coarse_gain: {low: 0.1, high: 1.0}}", "key of a score"), ("sweep: {coarse_gain: [0.1]}", "tune"),
        ("[", "YAML"), error=TeleopError),
    *of(read_study, "study.yaml",  # before the seeds are listed
        *((f"scenario: point\nseeds: {count}\nmetrics: [task.time_s]\n", "a number of seeds, at most 1000000")
          for count in (10**9, 10**50, 10**350))),
    *of(read_plan, "study.yaml",
        *((people(line), words) for line, words in (
            ("participants: 0", "people.participants is 0"), ("practice: yes", "people.practice is True"),
            ("order: random", "one of: fixed, shuffled, latin"), ("ask: often", "one of: trial, condition, end"),
            ("titel: x", "parameter of people is 'titel'"), ("title: ''", "people.title is ''"),
            ("duration: .nan", "people.duration"), ("repetitions: 150", "people.repetitions"),
            ("operator: nobody", "nobody"), ("questions: [{name: fun}]", "people.questions"),
            ("questions: [tlx, {name: effort, text: a, low: b, high: c}]", "name of a question is 'effort'"),
            ("questions: &a [*a]", "alias"))), error=TeleopError),
    *of(load_table, "arm.yaml", (None, "arm.yaml"), ("rows: [", "arm.yaml"), error=RecordingError),
]  # fmt: skip

# -- tables ----------------------------------------------------------------------------------------

RESTS = pd.read_csv(PUBLISHED)
Q = RCRT1.start + 0.01 * np.arange(20)[:, None]
POSES = pd.DataFrame(np.hstack((Q, RCRT1.fk(Q)[:, :3, 3])), columns=[*RCRT1.joint_names, "x", "y", "z"])
TABLES = [
    *of(lambda path: read_rests(path, RCRT1), "rests.csv", (None, "rests.csv"),
        (RESTS.drop(columns=["theta2", "target_d3"]), "lacks target_d3, theta2"),
        (RESTS.replace({"theta1": {0.78529: np.nan}}), "line 2"), (RESTS.assign(theta1="far"), "number"),
        (RESTS[RESTS["run"] == 1], "1 run"), (RESTS[:0], "no rows"),
        (RESTS.assign(target_d3=RESTS["target_d3"] + 1e-3 * RESTS["run"]), "several targets"), error=TeleopError),
    *of(lambda path: read_measured(path, RCRT1), "poses.csv",
        (POSES.drop(columns="theta4"), r"joint theta4 \(or q4\)"), (POSES.drop(columns="z"), "column for z"),
        (POSES.assign(theta1=["0", "0", "oops", *["0"] * 17]), "row 3 of 'theta1' is 'oops'"),
        (POSES.assign(d3=np.nan), "row 1 of 'd3' is 'nan'"),
        (POSES.rename(columns={"x": "x_s"}), "column 'x_s' is in 's'"),
        (POSES.assign(theta1=np.degrees(POSES["theta2"])), "far from its limits.*theta1_deg"), error=CalibrationError),
    *of(lambda path: read_measured(path, RCRT1), "poses.csv",
        ("", "no table"), (None, "No such file"), error=RecordingError),
    *of(lambda path: read_trace(str(path)), "pings.csv",
        (None, "can be read"), ("0,0.1\n2,0.1\n1,0.1\n", "line 3 has 1 s, the row before 2 s"),
        ("-1,0.1\n2,0.1\n", "line 1 has -1 s"), ("0,-0.2\n1,0.1\n", "line 1 has -0.2 s"),
        ("time,delay\n0,0.1\n1,fast\n", "in line 3"), ("0,nan\n1,0\n", "in line 1"),
        ("0,0.1\n1,35.2\n", "line 2 has 35.2 s: are the delays in ms"), ("0,0.1\n1,1e9\n", "line 2 has 1e.09 s"),
        ("1744909208000,0.1\n1744909208100,0.1\n", "line 1 has 1744909208000 s: are they in ms"),
        ("0,0.1\n100,0.1\n200,0.1\n", "not every 100 s: are its times in ms"), ("0,0.1\n", "two rows"),
        ("", "two rows")),
]  # fmt: skip

# -- shapes ----------------------------------------------------------------------------------------

CORNERS = np.array([(0, 0, 0), (1, 1, 0), (1, 0, 1), (0, 1, 1)])
FACES = np.array([(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)])


def pressed(*settings: str) -> Step:
    """A session that presses a mesh."""
    return lambda path: VirtualTime(
        configure("palpation", settings=["world=mesh", f"world.mesh.file={path}", *settings])
    )


def within(use: str) -> Step:
    """A session in whose world, or as whose fixture, there is a mesh."""
    mesh = (f"{use}.kind=mesh", f"{use}.mesh.file={{}}")
    return lambda path: VirtualTime(configure("coarse_box", settings=[one.format(path) for one in mesh]))


def box(change: Callable[[Any], object] = lambda mesh: None, size: Any = (60.0, 60.0, 30.0)) -> Step:
    """A box [mm] as a mesh, after a change of it."""

    def write(path: Path) -> None:
        mesh = trimesh.creation.box(size)
        change(mesh)
        mesh.export(path)

    return write


def opened(mesh: Any) -> None:
    mesh.update_faces(np.arange(len(mesh.faces)) != 0)


def turned(mesh: Any) -> None:
    mesh.faces[0] = mesh.faces[0][::-1]


def off(size: float, faces: Any) -> str:
    rows = [*(size * CORNERS).tolist(), *([3, *face] for face in faces.tolist())]
    return "\n".join((f"OFF\n4 {len(faces)} 0", *(" ".join(map(str, row)) for row in rows), ""))


def obj(size: float, faces: Any) -> str:
    rows = [("v", row) for row in (size * CORNERS).tolist()]
    rows += [("f", row) for row in (faces + 1).tolist()]
    return "\n".join(f"{kind} {' '.join(map(str, row))}" for kind, row in rows)


def heights(**more: float) -> Step:
    return lambda path: HEIGHT_FIELD.numbers(HeightFieldParameters(file=str(path), **more))


def table(columns: int) -> Step:
    return lambda path: np.save(path, np.zeros((31 if columns == 25 else 25, columns)))


SHAPES = [
    *of(pressed(), "mesh.stl", (None, r"^mesh\.file is.*No such file"), ("", r"^mesh\.file is .*must be a mesh")),
    *of(pressed(), "mesh.txt", ("solid", r"^mesh\.file is .*must be a mesh")),
    *of(pressed(), "mesh.zip", ("\x00" * 90, r"^mesh\.file is .*must be a mesh")),
    *of(pressed(), "mesh.obj",
        ("v 0 0 nothing\nf 1 1 1\n", r"^mesh\.file is .*must be a mesh"),
        (box(opened), r"^mesh\.file is.*it has a hole at the edge"),
        (box(turned), r"^mesh\.file is.*two triangles face opposite sides"),
        (box(size=(20.0, 20.0, 1e-6)), r"^mesh\.file is.*encloses a volume")),
    *(case for write, use in ((off, "world"), (obj, "fixture")) for case in of(
        within(use), f"mesh.{write.__name__}",
        (write(30.0, FACES[:0]), "triangles|can be read"), (write(1e-300, FACES), "mesh"),
        *((write(size, FACES), "longest side") for size in (1e120, 1e308, -1e308)))),
    *(case for setting, words in (
        ("mesh.scale=1.0", r"^mesh\.scale is.*now 60 m long"),
        ("mesh.scale=0.000001", r"^mesh\.scale is.*between 0.001 and 2 m long"),
        ("mesh.step=0.00005", r"^mesh\.step is.*at least 0\.00039 m"),
        ("mesh.step=0.02", r"^mesh\.step is.*at most 0\.0075 m"),
        (f"place={(RCRT1.fk(RCRT1.home)[:3, 3] - (0.0, 0.0, 0.01)).tolist()}", r"which is 5\.0 mm inside"))
      for case in of(pressed(f"world.{setting}"), "box.stl", (box(), words))),
    *of(heights(), "heights.csv", *((content, rf"^height_field\.file is.*{words}") for content, words in (
        (None, "a file with"), ("1,2,x", "ValueError"), ("", "no data"), ("0,0\n0,0", "4 x 4"),
        ("0,0,0,nan\n" * 4, "finite"), (b"\xff\xfe", "Unicode")))),
    *(case for more, columns, name in (
        ({"spacing": 1e-5}, 25, "step"), ({"step": 5e-5}, 25, "step"), ({"spacing": 0.1}, 25, "step"),
        ({"spacing": 0.1, "step": 5e-3}, 4, "spacing"))
      for case in of(heights(**more), "heights.npy", (table(columns), rf"^height_field\.{name} is"))),
]  # fmt: skip


@pytest.fixture(autouse=True)
def own_cache(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    """Grids of shapes are kept elsewhere, kernels where they always are."""
    monkeypatch.setenv("TELEOP_KERNELS", str(Path.home() / ".cache" / "teleop_core" / "kernels"))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))


@pytest.mark.parametrize("case", CONFIGURATIONS + TABLES + SHAPES, ids=attrgetter("words"))
def test_a_file_that_cannot_be_used_is_refused_in_one_line(case: Case, tmp_path: Path) -> None:
    assert_refused(case, tmp_path)
