"""Hostile pages at a real session: its arm gets no other command, and the stop stops it."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("viser")

import hostile
import teleop_core as tc
from browser import until
from console_process import STARTS, ConsoleProcess
from page_client import PageClient
from teleop_core.graph.operation import State

pytestmark = [pytest.mark.ros, pytest.mark.soak]


SETTLES = 1e-6  # filters come to rest within nanometres; a drag moves millimetres [m]


def saved(driver: PageClient, console: Any, name: Any) -> tc.Recording:
    """What has been recorded until now, closed under a name."""
    driver.set(driver.elements["name"], value=name)
    driver.click("Save as")
    folder = console.folder / name
    until((folder / "metadata.yaml").exists, f"{name} is closed", 60)
    return tc.open_recording(folder)


def test_arm_of_a_real_session_gets_no_other_command_and_stops_when_the_driver_says_so(tmp_path: Path) -> None:
    console = ConsoleProcess(tmp_path, "--out", tmp_path / "session")
    port = int(console.url.split(":")[2].strip("/"))
    try:
        until(lambda: "recorder is ready" in console.text, "a session", STARTS)
        with PageClient(port) as driver:
            until(lambda: "ENABLED</b>, homed" in driver.status, "it is homed", STARTS)
            saved(driver, console, "before")
            for attack in set(hostile.HOSTILE) - set(hostile.STOPPING):
                with PageClient(port) as watcher:
                    attack(watcher, driver)
                    watcher.sync()
            during = saved(driver, console, "during")
            assert driver.ask("/stop")[0] == 204
            until(lambda: driver.ask("/alive")[1]["is_stopped"], "the page looks stopped")
            after = saved(driver, console, "after")
        assert "Traceback" not in console.text, console.text
    finally:
        assert console.end() == 0, console.text
    setpoint = during["slave/setpoint_cp"][["x", "y", "z"]]
    assert len(setpoint) > 1000
    assert np.ptp(setpoint, axis=0).max() < SETTLES
    assert set(during["slave/operation"]["state"]) == {State.ENABLED}
    assert after["slave/operation"]["state"][-1] == State.FAULT
