"""Command lines that cannot be followed: exit code 2, one line that says what is right, and nothing is written."""

import re
import shlex
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

import teleop_exchange
from teleop_core.commands import cli

ROOT = Path(__file__).resolve().parents[3]
SCHEDULES = {"open.json": "{", "cut.json": '{"version": 1', "deep.json": "[" * 5}
PARTS = {"divides.py": "x = 1\n\ny = x / 0\n", "reads.py": "import json\njson.loads('{')\n",
         "lacks.py": "import nothing_of_this_name\n", "open.py": "x = (\n"}  # fmt: skip
CASES = [
    # command, words of the line
    ("", r"^teleop: a COMMAND is missing \(see teleop --help\)"),
    ("simm", "^teleop simm: COMMAND is 'simm', must be one of: sim, "),
    ("sim", r'^teleop sim: Command "sim" parameter --out requires an argument \(see teleop sim --help\)'),
    ("sim --out out more", r"^teleop sim: one argument too many: more \(see teleop sim --help\)"),
    ("sim --out out --sed 1", r"^teleop sim: Unknown option: --sed\. Did you mean --seed\?"),
    ("sim --out out --seed x", '^teleop sim: Invalid value for --seed: unable to convert "x" into int'),
    ("sim --out out --set", "^teleop sim: Command "),
    ("sim --scenario coarse_bix --out out", "coarse_bix.*coarse_box.*fine_box"),
    ("sim --set fine_gian=0.1 --out out", "fine_gian.*fine_gain"),
    ("sim --set fine_gain=200 --out out", "fine_gain.*200.*between"),
    ("sim --duration -1 --out out", "duration.*-1.*between"),
    ("sim --config /nowhere.yaml --out out", "/nowhere.yaml.*No such file"), ("sim --out example", "exists"),
    ("replay example --out example", "exists"), ("replay bag/metadata.yaml --out out", ""),
    ("live --out out --processes two", '^teleop live: Invalid value "two" for --processes. Choose'),
    ("evaluate", '^teleop evaluate: Command "evaluate" parameter BAGS requires an argument'),
    ("stop --domain 300", "^teleop stop: --domain is '300', must be the number of a ROS domain, 0 to 232"),
    *((f"parts --parts {name}", rf"{name}.*{told}") for name, told in (
        ("divides.py", r"ZeroDivisionError: division by zero \(line 3\)"),
        ("reads.py", r"JSONDecodeError: .* \(line 2\)"), ("lacks.py", r"ModuleNotFoundError: .* \(line 1\)"),
        ("open.py", r"SyntaxError: .*line 1\)"))),
    ("fit none.csv", "none.csv"), ("fit --json no/fit.json", "make it first"),
    ("robot r2d2", "rcrt1"), ("parameters nobody", "motion_scaling"), ("console --out bag", "exists already"),
    ("import hand.csv --out out --position a y z", "t, x, y, z"), ("import nothing.csv --out out", "does not exist"),
    ("import hand.csv --out out --unit km", "must be one of: m, auto, cm, mm, in"),
    ("import hand.csv --out bag", "exists already"),
    ("export bag --out out.csv --topics nowhere", "master/measured_cp"),
    ("export bag --out out", "lacks slave/measured_js"), ("export nothing --out out.csv", "does not exist"),
    ("experiment resolutoin", "resolution"), ("experiment resolution nosuch", "'nosuch', must be one of"),
    ("experiment resolution --json no/such.json", "does not exist"),
    ("experiment resolution --html example", "is a directory"),
    ("experiment resolution --html /proc/page.html", "cannot be written"),
    ("experiment resolution --seed -1", "seed is -1"), ("experiment resolution --seed one", "unable to convert"),
    ("reach nothing", "recording or scenario is 'nothing'"),
    ("reach bags/missing", "bags/missing: does not exist; give a recording"),
    ("reach bag --robot nobody", "must be one of: rcrt1"), ("reach bag --share 0", "--share 0 must be above 0"),
    ("reach bag bag --out x.yaml", "--out writes the proposal for one"),
    ("reach bag --html no/x.html", "make it first"), ("reach bag --arm left", "arm of"),
    ("calibrate --poses 1", "too few"), ("calibrate --poses 0", "at least"),
    ("calibrate --noise much", "--noise is 'much'"), ("calibrate --robot stewart", "chain of links"),
    ("calibrate --robot rcrt2", "rcrt1"), ("calibrate --fit d9", "one of: a1"),
    ("calibrate --fit d3 d4", "d4 acts as d3"), ("calibrate --errors milled", "cnc"),
    ("calibrate --choose best", "optimal, random"),
    ("calibrate --data none.csv", "none.csv: cannot be read: No such file"),
    ("calibrate --data published --poses 3", "--poses"),
    ("calibrate --data published --robot scara", "measured the rcrt1"),
    ("calibrate --noise ruler --frame unknown", "frame"), ("calibrate --out nowhere/arm.yaml", "nowhere"),
]  # fmt: skip
ROS = [
    ("drill --seeds 2 --out bags", "--schedule or --seeds 1"),
    ("drill --seeds 2 --search store", "without names, --short, --drives and --search or --schedule"),
    ("drill --search store --composed", "without --composed"), ("drill --search store --minutes nan", "above 0"),
    ("drill --search store --scheduler nowhere", "no Dask scheduler answers at nowhere"),
    ("drill --seeds 2 --scheduler tcp://a:1", "--scheduler is 'tcp://a:1', must be given with --search"),
    ("drill --search store --seed today", "seed"), ("drill --seeds 2 stop_topic", "without names"),
    ("drill --seed 3 stop_topic", "with --simulated"),
    *((f"drill --seeds {count}", f"--seeds is {count}, must be at least 1") for count in (0, -1)),
    *((f"drill --schedule {name}", "JSON of a schedule") for name in SCHEDULES),
    ("drill --schedule nowhere.json", "nowhere.json: cannot be read as a schedule"),
    *((f"{words} --domain 97", "given for") for words in (
        "topic hz", "param get slave", "param set slave mode", "service call")),
]  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What a reader may have: a table, its recording, a recording of a session, texts."""
    made = tmp_path_factory.mktemp("refused")
    t = 0.1 * np.arange(30)
    rows = np.column_stack((t, 0.01 * np.sin(t), 0.01 * np.cos(t), 0.001 * t))
    np.savetxt(made / "hand.csv", rows, header="t,x,y,z", comments="", delimiter=",")
    teleop_exchange.import_recording(made / "hand.csv", made / "bag", unit="m")
    (made / "example").symlink_to(ROOT / "bags/example")
    for name, text in (SCHEDULES | PARTS).items():
        (made / name).write_text(text, encoding="utf-8")
    return made


@pytest.mark.parametrize(("line", "told"), CASES + (ROS if find_spec("rclpy") else []))
def test_what_cannot_be_followed_is_told_in_one_line_and_writes_nothing(
    line: str, told: str, folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(folder)
    before = sorted(folder.iterdir())
    assert cli.main(shlex.split(line)) == 2
    out, error = capsys.readouterr()
    lines = [one for one in error.splitlines() if not one.startswith("note:")]
    assert out == ""
    assert len(lines) == 1, error
    assert re.search(told, lines[0]), lines[0]
    assert sorted(folder.iterdir()) == before
