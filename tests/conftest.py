"""Fixtures that several folders of tests share."""

import gc
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import settings

from browser import chromium
from copies import run_copy
from teleop_core.kernels import IS_COMPILED

# Examples are the same in every run, and no clock decides: compiling may take its time.
settings.register_profile("teleop", deadline=None, derandomize=True, database=None)
settings.load_profile("teleop")
if not IS_COMPILED:
    # Pure-Python kernels are a hundred times slower, and NumPy would warn where compiled code goes on with infinity.
    settings.register_profile("pure", settings.get_profile("teleop"), max_examples=10)
    settings.load_profile("pure")
    np.seterr(all="ignore")

if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
    # A shell without job control starts what runs in the background (`pytest &`) deaf to Ctrl-C,
    # and all its children with it: tests that end a process so would wait for ever.
    signal.signal(signal.SIGINT, signal.default_int_handler)

gc.set_threshold(100_000, 20, 20)  # to look for garbage among all tests and kernels takes a seventh of the time

pytest_plugins = ["forgotten_parts", "middleware_faults"]

LIVE = Path(__file__).parent / "ros"


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Insist that live tests are where they are looked for, and that a soak test counts as slow."""
    for item in items:
        if item.get_closest_marker("ros") and LIVE not in item.path.parents:
            raise pytest.UsageError(f"{item.nodeid}: tests of live nodes belong into tests/ros")
        if item.get_closest_marker("soak"):
            item.add_marker(pytest.mark.slow)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: Any) -> Iterator[None]:
    """Let a skipped test that gives no reason fail; reasons are told at the end of the run."""
    report: Any = yield
    if report.skipped and isinstance(report.longrepr, tuple):
        reason = report.longrepr[2].removeprefix("Skipped").removeprefix(": ")
        if not reason.strip() or reason == "unconditional skip":
            report.outcome, report.longrepr = "failed", f"{item.nodeid} is skipped without a reason"
    return report


@pytest.hookimpl(wrapper=True)
def pytest_runtest_teardown(item: pytest.Item) -> Iterator[None]:
    """Let a test fail that leaves a priority in its process, which all later tests and what they start would have."""
    yield
    if os.sched_getscheduler(0) in {os.SCHED_FIFO, os.SCHED_RR}:
        left = os.sched_getparam(0).sched_priority
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
        pytest.fail(f"{item.nodeid} leaves a real-time priority of {left}")


Run = Callable[..., "subprocess.CompletedProcess[str]"]


@pytest.fixture(scope="session")
def teleop() -> Run:
    """Run the ``teleop`` command as a user would, in a process of its own."""

    def run(*arguments: object, code: int = 0) -> "subprocess.CompletedProcess[str]":
        command = [sys.executable, "-m", "teleop_core.commands.cli", *map(str, arguments)]
        done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
        assert done.returncode == code, done.stdout + done.stderr
        return done

    return run


@pytest.fixture(scope="session")
def browser() -> str:
    """Path of a Chromium; a test that asks for it is skipped without one, in CI it fails."""
    return chromium()


@pytest.fixture(scope="session")
def teleop_again() -> Run:
    """Run the ``teleop`` command as ``teleop`` does, but in a copy of a process that has loaded.

    A copy knows more modules than a command that a user types, and has one seed of hashes with all others: what a
    command does when all goes well, and that its bytes are the same again, is for ``teleop`` to show.
    """

    def run(*arguments: object, code: int = 0) -> "subprocess.CompletedProcess[str]":
        done = run_copy(["teleop", *map(str, arguments)], "teleop_core.commands.cli:main")
        assert done.returncode == code, done.stdout + done.stderr
        return done

    return run


@pytest.fixture(scope="session")
def recording(teleop: Run, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Twelve seconds of a hand with clutch, both modes and the box, made once.

    Before them the slave moves to where it starts, and the hand rests.
    """
    out = tmp_path_factory.mktemp("bags") / "session"
    settings = (
        "path.approach_time=1.0",
        "buttons.clutch=[4.0, 5.0]",
        "buttons.mode=[6.0, 9.0]",
        "buttons.fixture=[2.0, 11.0]",
    )
    teleop("sim", "--scenario", "mode_switching", "--duration", 12, "--out", out, "--set", *settings)
    return out
