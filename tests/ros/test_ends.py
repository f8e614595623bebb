"""Ends: in order, whatever brings them about, and nothing is left behind."""

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import psutil
import pytest

from live_process import TIMEOUT, LiveProcess, are_gone, wait_until
from teleop_core.bags.reader import Bag
from teleop_core.graph import BUILT_IN, RECORDER_NAME, topics
from teleop_core.middleware.real_time import is_priority_granted
from teleop_core.nodes.observer import ReportReader

if TYPE_CHECKING:
    pass

pytestmark = [pytest.mark.ros, pytest.mark.slow]
NODES = [*BUILT_IN, RECORDER_NAME]
HANGS = '''
import time
from pathlib import Path

import teleop_core as tc
from teleop_core.graph.stage import STAGES, RunningStage
from teleop_core.graph.topics import SLAVE_MEASURED_JS

BEAT = tc.Topic("test/beat", tc.Kind.NUMBERS, SLAVE_MEASURED_JS.stamp, columns=("beat",))


class Hanging(RunningStage):
    """Works until a file is there, and never comes back from a step after."""

    count = 0

    def step(self) -> None:
        self.count += 1
        self.signals["test_beat_ns"] = self.signals["now_ns"]
        while self.count % 100 == 0 and Path(__file__).with_name("hang").exists():
            time.sleep(0.01)

    def load(self):
        return lambda: None


tc.register_stage(
    tc.Stage("hanging", tc.NoParameters, reads=(), writes=(BEAT,),
             make=lambda parameters, dt: Hanging(STAGES.find("hanging"), 6, dt))
)
'''


both_ways = pytest.mark.parametrize(
    "composed_option", [pytest.param((), id="sides"), pytest.param(("--composed",), id="one", marks=pytest.mark.soak)]
)


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Callable[..., object]]:
    """Starter of a live session."""
    started = []

    def start(*arguments: Any, **options: Any) -> LiveProcess:
        started.append(LiveProcess(tmp_path, *arguments, **options))
        return started[-1]

    yield start
    for process in started:
        process.close()


@pytest.mark.parametrize(
    ("number", "composed_option"),
    [
        pytest.param(signal.SIGHUP, (), id="SIGHUP-sides", marks=pytest.mark.soak),
        pytest.param(signal.SIGQUIT, (), id="SIGQUIT-sides", marks=pytest.mark.soak),
        pytest.param(signal.SIGKILL, (), id="SIGKILL-sides"),
        pytest.param(signal.SIGHUP, ("--composed",), id="SIGHUP-one", marks=pytest.mark.soak),
        pytest.param(signal.SIGQUIT, ("--composed",), id="SIGQUIT-one", marks=pytest.mark.soak),
        pytest.param(signal.SIGKILL, ("--composed",), id="SIGKILL-one", marks=pytest.mark.soak),
    ],
)
def test_no_node_outlives_the_command_and_the_recording_is_closed(
    start: Callable[..., Any], number: Any, composed_option: tuple[str, ...]
) -> None:
    session = start(*composed_option)
    session.wait_running()
    nodes = session.signal(number)
    assert len(nodes) == (2 if composed_option else 3)  # with the recorder
    wait_until(lambda: are_gone(nodes), "end of all nodes")
    code = session.wait()
    assert code == (-signal.SIGKILL if number == signal.SIGKILL else 0), session.text
    assert session.recorded().topics["slave/measured_js"].count > 100
    left = [path.name for path in session.temporary.rglob("*") if not path.is_dir()]
    marks = [name for name in left if re.fullmatch(r"\d+\.domain", name)]  # the next session removes it
    assert left == (marks if number == signal.SIGKILL else [])


@both_ways
def test_a_stage_that_never_comes_back_is_found_within_a_second(
    start: Callable[..., Any], tmp_path: Path, composed_option: tuple[str, ...]
) -> None:
    parts = tmp_path / "hangs.py"
    parts.write_text(HANGS)
    session = start(*composed_option, "--parts", str(parts), "--set", "teleop.stages=[hanging]")
    session.wait_running()
    (tmp_path / "hang").touch()
    assert session.wait(120) == 2
    found = re.search(r"\[FATAL\] \[([\d.]+)\].* hangs: it made no progress for 0.8 s", session.text)
    assert found, session.text
    assert "hangs.py" in session.text  # where it is
    bag = session.recorded()
    # When its last step was made, whenever that was recorded.
    begin, end = bag.read("test/beat").stamp_ns[-1] * 1e-9, float(found[1])
    assert 0.7 < end - begin < 60.0  # one that waits for a processor does not hang
    assert bag.topics["slave/measured_js"].count > 0


def domain_said_first(session: LiveProcess) -> str:
    """The domain that others need; the place of the recording is said next."""
    lines = [line for line in session.text.splitlines() if not line.startswith("note: ")]
    assert lines[1] == f"recording to {session.bag}"
    domain = lines[0].rpartition("ROS_DOMAIN_ID=")[2]
    with ReportReader(int(domain)) as observer:

        def is_heard() -> bool:
            observer.listen(0.1)
            return "slave" in observer.statuses

        wait_until(is_heard, "its nodes there")
    return domain


@pytest.mark.soak
def test_a_second_session_in_a_domain_is_refused_and_the_first_ends_in_order_whoever_asks(
    start: Callable[..., Any], tmp_path: Path
) -> None:
    first = start("--composed")
    first.wait_running()
    domain = domain_said_first(first)
    folder = tmp_path / "second"  # with temporary files of its own, as another user's
    folder.mkdir()
    second = LiveProcess(folder, "--composed", env={"ROS_DOMAIN_ID": domain})
    assert second.wait(120) == 2, second.text
    assert "another session sends slave/setpoint_js on ROS domain" in second.text
    nodes = first.signal(signal.SIGQUIT)
    assert first.wait() == 0, first.text
    wait_until(lambda: are_gone(nodes), "end of all nodes")
    assert first.recorded().topics["slave/measured_js"].count > 100


def test_a_process_that_stands_still_ends_the_session(start: Callable[..., Any]) -> None:
    session = start()
    session.wait_running()
    (node,) = session.nodes("inverse_kinematics")
    node.suspend()
    assert session.wait() == 2
    assert "hand_side does not run: no sign of life" in session.text
    assert session.recorded().topics["slave/measured_js"].count > 100


def test_a_session_that_waits_for_a_recorder_that_stands_still_uses_no_processor(start: Callable[..., Any]) -> None:
    if is_priority_granted(31):  # where it matters most
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(31))
    try:
        session = start()
    finally:
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    session.wait_running()
    (recorder,) = session.nodes(RECORDER_NAME)
    waiting = psutil.Process(session.process.pid)
    recorder.suspend()
    session.process.send_signal(signal.SIGINT)
    wait_until(lambda: session.nodes() == [recorder], "the end of the other processes")
    begin, before = time.monotonic(), used(waiting)
    wait_until(lambda: time.monotonic() - begin > 3.0, "three seconds")
    assert used(waiting) - before < 0.3 * (time.monotonic() - begin)
    recorder.resume()
    assert session.process.wait(TIMEOUT) == 0
    assert Bag(session.bag).topics


def used(process: psutil.Process) -> float:
    """Processor time of a process and of what it started, as far as that runs [s]."""
    every = (process, *process.children(recursive=True))
    return sum(sum(one.cpu_times()[:2]) for one in every)


@pytest.mark.soak
def test_a_session_starts_with_no_kernel_compiled_on_a_busy_machine(start: Callable[..., Any], tmp_path: Path) -> None:
    busy = subprocess.Popen([sys.executable, "-c", "while True: pass"])
    try:
        session = start("--composed", duration=1.0, env={"NUMBA_CACHE_DIR": str(tmp_path / "cache")})
        assert session.wait(400) == 0, session.text
    finally:
        busy.kill()
        busy.wait()
    assert "nodes: compiling kernels" in session.text
    counts = {name: topic.count for name, topic in session.recorded().topics.items()}
    assert counts[topics.SLAVE_MEASURED_JS.name] > 100


@pytest.mark.soak
@pytest.mark.parametrize("composed_option", [(), ("--composed",)], ids=["sides", "one"])
def test_sessions_start_and_end_again_and_again(
    start: Callable[..., object], tmp_path: Path, composed_option: tuple[str, ...]
) -> None:
    for number in range(3):
        folder = tmp_path / str(number)
        folder.mkdir()
        session = LiveProcess(folder, *composed_option, duration=0.1 + 0.3 * number)
        assert session.wait(300) == 0, session.text
        bag = session.recorded()
        assert bag.end_ns - bag.start_ns > 1e9 * (0.1 + 0.3 * number)


@both_ways
def test_a_session_that_a_shell_started_in_the_background_ends_like_any(
    start: Callable[..., Any], composed_option: tuple[str, ...]
) -> None:
    session = start(*composed_option, duration=1.0, ignores=(signal.SIGINT, signal.SIGQUIT))
    for name in NODES:  # from then on nothing is started or compiled
        session.wait_text(f"{name} is ready")
    begun = time.monotonic()
    assert session.wait(120) == 0, session.text
    assert time.monotonic() - begun < 25.0  # one unheeded signal alone costs 30 s
    session.recorded()


def test_no_socket_is_lost_where_many_ask_for_a_free_domain_at_once() -> None:
    program = (
        "import sys\n"
        "from concurrent.futures import ThreadPoolExecutor\n"
        "from teleop_core.nodes.children import free_domain\n"
        "sys.setswitchinterval(1e-6)\n"
        "with ThreadPoolExecutor(8) as pool:\n"
        "    print(len(list(pool.map(lambda _: free_domain(), range(2000)))))\n"
    )
    command = [sys.executable, "-W", "always::ResourceWarning", "-c", program]
    ended = subprocess.run(command, capture_output=True, text=True, check=True)
    assert ended.stdout.split() == ["2000"]
    assert "ResourceWarning" not in ended.stderr
