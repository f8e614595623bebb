"""Operators handed over in Python: a data frame is the hand that its table is."""

import runpy
import sys

import numpy as np
import pandas as pd
import pytest

import teleop_core as tc

T = np.linspace(0.0, 1.5, 151)
FRAME = pd.DataFrame({"t": T, "x": 0.01 * np.sin(T), "y": 0.005 * T, "z": 0.0 * T, "clutch": T > 1})


def test_a_data_frame_moves_the_hand_as_its_array_does() -> None:
    rows = FRAME.reindex(columns=["t", "x", "y", "z", "rx", "ry", "rz", "clutch", "fixture", "mode"], fill_value=0.0)
    by_array = tc.run(operator=rows.to_numpy(dtype=float), duration=1.5)
    for frame in (FRAME, FRAME.set_index("t")):
        by_frame = tc.run(operator=frame, duration=1.5)
        for topic in ("master/measured_cp", "master/buttons"):
            np.testing.assert_array_equal(by_frame[topic].values, by_array[topic].values)


def test_a_data_frame_of_something_else_is_refused_with_what_is_needed() -> None:
    for frame in (FRAME.rename(columns={"x": "depth"}), FRAME.assign(force=1.0)):
        with pytest.raises(tc.ParameterError, match="columns of t, x, y, z"):
            tc.run(operator=frame, duration=1.0)


def test_the_crtk_client_says_what_it_lacks(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "crtk_msgs", None)
    monkeypatch.setitem(sys.modules, "crtk_msgs.msg", None)
    with pytest.raises(SystemExit) as end:
        runpy.run_path("examples/crtk_client.py", run_name="__main__")
    assert "which is not installed: " in str(end.value)
    assert "\n" not in str(end.value)
