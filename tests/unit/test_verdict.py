"""The verdict on a session: one line, the worst first, the same wherever a score is shown."""

import io
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console

import teleop_core as tc
from teleop_core.evaluation.command import evaluate_bags
from teleop_core.evaluation.verdict import verdict_of

FINE = {
    "reach.followed_share": 0.999, "asked_error_mm.max": 6.0, "command_error_mm.max": 5.5,
    "position_error_mm.rms": 0.3, "latency_ms.total.p99": 3.0, "ticks.executed": 10000,
    "ticks.missed": 0, "topics.slave/servo_cp.count": 9000, "topics.slave/servo_cp.gaps": 0,
    "fixture.penetration_max_mm": None, "fixture.kind": "box",
}  # fmt: skip


def ports(*energies: float) -> dict[str, float]:
    """Energies [mJ] in at hand and slave, then out."""
    keys = ("hand.in_mj", "slave.in_mj", "hand.out_mj", "slave.out_mj")
    return {f"passivity.{key}": value for key, value in zip(keys, energies, strict=True)}


def test_a_drift_is_named_before_the_share_that_was_followed() -> None:
    drifted = FINE | {"reach.followed_share": 0.94, "asked_error_mm.max": 67.0,
                      "reach.joint_share": 0.06}  # fmt: skip
    found = verdict_of(drifted)
    assert found.text == (
        "up to 67 mm from where the hand led; followed 94 % of the time (6.0 % at a joint's end)"
    )
    assert found.worst == "asked_error_mm.max"
    assert not found.is_good


@pytest.mark.parametrize(
    ("changes", "worst", "text"),
    [
        ({}, None, "nothing stands out: followed 99.9 % of the time, 0.3 mm RMS"),
        ({"asked_error_mm.max": 12.0, "command_error_mm.max": 11.0}, None, "nothing"),  # filters
        ({"latency_ms.total.p99": 80.0}, "latency_ms.total.p99", "80 ms from hand to setpoint"),
        ({"ticks.missed": 300}, "ticks.missed", "300 control ticks left out"),
        ({"topics.slave/servo_cp.gaps": 1000}, "topics", "1000 messages missing (10 %)"),
        ({"fixture.penetration_max_mm": 2.5}, "fixture.penetration_max_mm", "2.5 mm out of"),
        ({"position_error_mm.rms": 4.0}, "position_error_mm.rms", "4 mm RMS"),
        (ports(40.0, 3.0, 11.0, 64.0), "passivity.slave.out_mj", "hand and slave gave 75 mJ, 32"),
        (ports(40.0, 3.0, 11.0, 32.5), None, "nothing"),  # what is lent
    ],
)  # fmt: skip
def test_whatever_is_worst_comes_first(
    changes: dict[str, float], worst: str | None, text: str
) -> None:
    found = verdict_of(FINE | changes)
    assert found.worst == worst
    assert found.text.startswith(text)


@pytest.fixture(scope="module")
def drifting(tmp_path_factory: pytest.TempPathFactory) -> tc.Recording:
    """A hand that is too fast for the arm."""
    times = np.linspace(0.0, 4.0, 401)
    way = 0.2 * np.sin(0.25 * np.pi * times) ** 2
    hand = np.column_stack((times, way, 0.0 * times, 0.0 * times))
    path = tmp_path_factory.mktemp("verdict") / "drifting"
    return tc.run(operator=hand, duration=9.0, out=path)


def test_one_line_opens_table_json_page_and_python(drifting: Any, tmp_path: Path) -> None:
    text = drifting.score().verdict.text
    assert text.startswith("followed ")
    shown = io.StringIO()
    console = Console(file=shown, width=100)
    paths = tmp_path / "s.json", tmp_path / "page.html"
    evaluate_bags([drifting.path], *paths, console)
    assert shown.getvalue().splitlines()[0] == f"drifting: {text}"
    assert json.loads(paths[0].read_text())[0]["verdict"]["text"] == text
    page = paths[1].read_text()
    opening = page[: page.index("<details")]
    assert f'<p class="verdict bad">{text}</p>' in opening.replace("&#x27;", "'")
    assert opening.count("<dd>") == 5
    assert opening.count("<svg") == 2
    assert text in repr(drifting.score())


def test_rows_that_say_nothing_and_figures_nobody_compares_stay_out(
    drifting: Any, tmp_path: Path
) -> None:
    shown = io.StringIO()
    evaluate_bags([drifting.path], None, tmp_path / "page.html", Console(file=shown, width=100))
    for absent in ("0/0/0", " – ", "slave outside", "Vongbunyong", "agrees"):
        assert absent not in shown.getvalue()
    page = (tmp_path / "page.html").read_text()
    table = page[page.index("<details") : page.index("</details>")]
    assert "published" not in table


def test_scores_are_a_row_of_a_data_frame_each(drifting: tc.Recording) -> None:
    score = drifting.score()
    values = score.to_dict()
    assert values["position_error_mm.rms"] == score.position_error_mm.rms
    frame = tc.frame_of([score, score])
    assert len(frame) == 2
    assert frame["reach.followed_share"].tolist() == [score.reach.followed_share] * 2
    assert frame["verdict.text"][0] == score.verdict.text
