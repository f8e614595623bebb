"""Faults that the middleware is known for: the only ones after which a test of live nodes is rerun.

A race of ours fails at once. What was rerun is counted and named at the end of the run.

- A best-effort writer may know its reader before the reader knows it, and queues may overflow on a
  busy machine: samples are lost. The numbers that the middleware gives them prove it.
- Fast DDS 2.14 crashes now and then when a participant leaves while others are being discovered:
  in a thread of its own, or in the call that closes the participant.
"""

import faulthandler
import signal
import tempfile
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

RERUNS = 2
_CRASHES = (-signal.SIGSEGV, -signal.SIGABRT, -signal.SIGBUS)


class MiddlewareLossError(Exception):
    """Samples did not arrive: the numbers that the middleware gives them have a gap."""


class MiddlewareCrashError(Exception):
    """A process ended by a crash inside the middleware."""


def is_crash_of_middleware(log: str) -> bool:
    """Whether this output of ``faulthandler`` tells of a crash inside the middleware.

    The handler marks the thread that crashed as the current one if Python knows it, and lists its
    calls from the innermost one on.
    """
    if "Fatal Python error" not in log:
        return False
    _, found, calls = log.partition("Current thread")
    innermost = calls.splitlines()[1:2]
    return not found or any("/rclpy/" in line or "<no Python frame>" in line for line in innermost)


def check_end(name: str, exit_code: int, log: str) -> None:
    """Refuse the crash of a process that is not ours to answer for.

    Raises:
        MiddlewareCrashError: It ended so.
    """
    if exit_code in _CRASHES and is_crash_of_middleware(log):
        raise MiddlewareCrashError(f"{name} ended with {signal.Signals(-exit_code).name}")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark tests of live nodes to be rerun after these faults alone."""
    known = [MiddlewareLossError, MiddlewareCrashError]
    for item in items:
        if item.get_closest_marker("ros"):
            item.add_marker(pytest.mark.flaky(reruns=RERUNS, only_rerun=known))


# -- crashes of the process that runs the tests --------------------------------------------------


def _crash_log(run: str, worker: str) -> Path:
    return Path(tempfile.gettempdir()) / f"pytest_crash_{run}_{worker}.log"


def pytest_sessionstart(session: pytest.Session) -> None:
    """Let a worker write down where it crashes."""
    given: dict[str, Any] | None = getattr(session.config, "workerinput", None)
    if given is not None:
        path = _crash_log(given["testrunuid"], given["workerid"])
        session.config.stash[_FILE] = path.open("w")
        faulthandler.enable(session.config.stash[_FILE])


_FILE: pytest.StashKey[Any] = pytest.StashKey()


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Tidy up after a worker that did not crash."""
    if (file := session.config.stash.get(_FILE, None)) is not None:
        faulthandler.enable()
        file.close()
        Path(file.name).unlink()


@pytest.hookimpl(wrapper=True, optionalhook=True)
def pytest_handlecrashitem(crashitem: str, report: Any, sched: Any) -> Iterator[None]:
    """Let the crash of a worker count as a failure unless it is known for what it is."""
    result = yield
    node = getattr(report, "node", None)
    log = ""
    if node is not None:
        path = _crash_log(node.workerinput["testrunuid"], node.workerinput["workerid"])
        log = path.read_text(errors="replace") if path.exists() else ""
        path.unlink(missing_ok=True)
    if is_crash_of_middleware(log):
        report.longrepr = f"MiddlewareCrashError: {report.longrepr}"
    else:
        report.outcome = "failed"
        report.longrepr = f"{report.longrepr}\n{log}"
    return result


# -- the summary ---------------------------------------------------------------------------------


def pytest_terminal_summary(terminalreporter: Any) -> None:
    """Name and count what was rerun."""
    reports = terminalreporter.stats.get("rerun", [])
    if not reports:
        return
    known = (MiddlewareLossError.__name__, MiddlewareCrashError.__name__)
    reasons = [_reason(str(report.longrepr)) for report in reports]
    counts = Counter(next((n for n in known if n in reason), "unknown") for reason in reasons)
    text = ", ".join(f"{name} {count}" for name, count in counts.items())
    terminalreporter.write_sep("=", f"reruns because of the middleware: {text}")
    for report, reason in zip(reports, reasons, strict=True):
        terminalreporter.write_line(f"{report.nodeid}: {reason}")


def _reason(text: str) -> str:
    """Line of a failure that names the exception."""
    lines = text.strip().splitlines()
    named = [line for line in lines if "MiddlewareLossError:" in line or "CrashError:" in line]
    return (named or lines)[-1].removeprefix("E").strip()
