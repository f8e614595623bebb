"""Live session: runs the graph as several processes, which are started, watched, recorded and stopped."""

import tempfile
import time
from collections.abc import Collection, Mapping
from contextlib import suppress
from pathlib import Path
from typing import IO, Any

from rich.console import Console

from teleop_core.bags.finding import check_new
from teleop_core.base.errors import SessionError
from teleop_core.base.plain_yaml import written
from teleop_core.base.texts import printable
from teleop_core.graph.graph import FRAMES_NAME, HAND, RECORDER_NAME
from teleop_core.graph.layers import SESSION
from teleop_core.graph.topics import SLAVE_SETPOINT_JS
from teleop_core.middleware.real_time import is_priority_granted
from teleop_core.nodes.beside import BesideSession, processes_beside
from teleop_core.nodes.children import Child, end_all, environment
from teleop_core.nodes.crews import Crew, Processes, crews
from teleop_core.nodes.interrupt import Interrupt
from teleop_core.nodes.keys import Keys
from teleop_core.nodes.observer import WARNING, ReportReader, Status
from teleop_core.nodes.remote_control import RemoteControl
from teleop_core.nodes.sessions import announced
from teleop_core.nodes.starter import START_TIMEOUT, Starter
from teleop_core.nodes.task_end import TaskEnd
from teleop_core.session.configuration import Configuration
from teleop_core.session.links import link_texts
from teleop_core.session.notes import notes_of
from teleop_core.slave.parameters import SlaveParameters

SILENCE = 30.0
"""A working node that has not reported for this time counts as failed [s].

A process or a loop that hangs is detected within seconds by :mod:`teleop_core.nodes.children` and
:mod:`teleop_core.nodes.watch`.
"""
_LOOK = 0.5
"""A sender of setpoints that is discovered sooner than this after the start of the processes belongs to another
session [s]."""
_ALONE = 1.0
"""A session that has been alone in its domain for this time, with all nodes at work, owns the domain; later sessions
end [s]."""

_TRANSPORT = dict.fromkeys(Processes, 0.3e-3) | {Processes.NODES: 1.4e-3}
"""Time from a sample of the device to the force on the device [s], as measured by `make bench`. With one process per
node, it is the time of two of the three hops from master to slave; otherwise, the time within a process."""
_PRIORITY = 20
"""SCHED_FIFO priority of loops if a session does not set one and the system allows it."""
_NEWS_PERIOD = 5.0  # time between two lines about a node that starts slowly [s]


def live(
    configuration: Configuration,
    out: Path,
    console: Console,
    *,
    processes: Processes = Processes.SIDES,
    without: Collection[str] = (),
    interrupt: Interrupt | None = None,
    domain: int | None = None,
) -> None:
    """Run and record a session as ROS 2 nodes, for the configured duration or until Ctrl-C.

    With ``teleop.ends_with_task`` the session ends when no task has a goal left.

    Args:
        configuration: Configuration of the session, with its duration.
        out: Directory of the recording, which is created.
        console: Console that shows the progress.
        processes: Distribution of the nodes over processes.
        without: Nodes that are not started because other nodes replace them, for example an arm bridge instead of
            ``slave_sim``.
        interrupt: Object that ends the session from another thread; None for signals only.
        domain: ROS domain; None for ``ROS_DOMAIN_ID``, or a free domain if that is not set.

    Raises:
        RecordingError: The directory exists.
        UnknownNameError: ``without`` names a node that does not exist.
        SessionError: The ROS domain already has a session; or a node did not start, died or hangs. The recording is
            closed even then.
    """
    out = Path(out).absolute()
    check_new(out)
    shared = crews(configuration.graph, processes, without)
    env = environment(domain)
    interrupt = interrupt or Interrupt()
    # A file without a name needs no removal, however this process ends.
    with (
        tempfile.TemporaryFile("w+") as parameters,
        Starter(configuration.text(), env) as starter,
        interrupt.caught(),
        announced(int(env["ROS_DOMAIN_ID"])),
        ReportReader(int(env["ROS_DOMAIN_ID"])) as observer,
    ):
        priority = _priority(configuration, processes)
        parameters.write(written(session_parameters(configuration, str(out), priority=priority)))
        parameters.flush()
        session = _Session(configuration, console, observer, parameters, env, interrupt, starter)
        session.crews = shared
        observer.has_heartbeat = any(
            isinstance(group, SlaveParameters) and group.operation.heartbeat > 0.0
            for group in configuration.groups.values()
        )
        session.tell_where(out)
        for note in notes_of(configuration, transport=_TRANSPORT[processes]):
            session.say(f"note: {note}")
        if priority == 0 and processes is not Processes.NODES:
            session.say(f"note: {_UNGRANTED}")
        with Keys(observer.press) as keys:
            session.run(keys)


_UNGRANTED = (
    "the system grants no SCHED_FIFO, so loops are scheduled as ordinary threads and are late more "
    "often; grant it with an rtprio line in /etc/security/limits.conf"
)


def _priority(configuration: Configuration, processes: Processes) -> int | None:
    """Priority of the loops; None: as configured.

    With one process per node the priority stays 0, because these processes together need more than two processors.
    """
    if configuration.session.real_time.priority >= 0 or processes is Processes.NODES:
        return None
    return _PRIORITY if is_priority_granted(_PRIORITY) else 0


class _Session:
    """Processes of one session and their reports."""

    def __init__(
        self,
        configuration: Configuration,
        console: Console,
        observer: ReportReader,
        parameters: IO[Any],
        env: dict[str, str],
        interrupt: Interrupt,
        starter: Starter,
    ) -> None:
        self._duration = float(configuration.session.duration)
        self._graph = configuration.graph
        ends = configuration.session.ends_with_task
        self._task_end = TaskEnd(observer, self._graph) if ends else None
        self._console, self._observer = console, observer
        self._parameters, self._env, self._interrupt = parameters, env, interrupt
        self._starter = starter
        self._children: dict[str, Child] = {}
        self._beside = BesideSession(configuration, env, starter, self.say)
        self._ready = 0.0
        self.crews = crews(self._graph)

    def tell_where(self, out: Path) -> None:
        """Print how to find the nodes, and the path of the recording."""
        domain = self._env["ROS_DOMAIN_ID"]
        self.say(f"ROS domain {domain}; others join it with ROS_DOMAIN_ID={domain}")
        self.say(f"recording to {out}")

    def run(self, keys: Keys) -> None:
        """Start, watch and stop all nodes; the recorder starts first and stops last."""
        self._keys = keys
        try:
            self._work()
        except BaseException as error:
            failures = self._stop()
            if isinstance(error, SessionError) and failures:
                raise SessionError("\n".join((str(error), *failures))) from error
            raise
        if failures := self._stop():
            raise SessionError("\n".join(failures))

    def _work(self) -> None:
        is_begun = False
        try:
            self._await_starter()
            for crew in self.crews:
                self._start(crew)
            self._beside.start()
            if self._keys.is_there:
                self.say("press space to stop all arms, and e to let them continue")
            self._await_operator()
            is_begun = True
            self._watch()
        except KeyboardInterrupt:
            if not is_begun:
                raise SessionError("stopped before all nodes were ready") from None
            self.say("stopped")

    def _await_starter(self) -> None:
        """Wait until the starter has loaded everything that the nodes share."""
        progress = _Progress({"nodes": self._starter})
        while not self._starter.is_ready(0.1):
            self._interrupt.check()
            for line in progress.news():
                self.say(line)

    def _start(self, crew: Crew) -> None:
        for name in crew:
            self._children[name] = Child(name, self._parameters, self._env, self._starter, nodes=crew[name])
        waiting = [node for nodes in crew.values() for node in nodes]
        home = {node: name for name, nodes in crew.items() for node in nodes}
        progress = _Progress(self._children)
        while waiting:
            self._observer.listen(0.1)
            self._check_alive()
            if not self._ready and progress.since_begin() < _LOOK:
                self._insist_on_one_owner(0)
            for name in [name for name in waiting if self._observer.is_active(name)]:
                if self._children[home[name]].doing != "at work":  # the sender is a node of another session
                    continue
                waiting.remove(name)
                self.say(f"{name} is ready")
            for line in progress.news():
                self.say(line)
            if waiting and progress.age() > START_TIMEOUT:
                child = self._children[home[waiting[0]]]
                reason = f"{waiting[0]} is not ready and made no progress for {START_TIMEOUT:g} s"
                raise SessionError(reason + child.last_words())
        self._ready = time.monotonic()

    def _insist_on_one_owner(self, own: int) -> None:
        """Refuse a domain in which arms with the same names already run, on any machine.

        Args:
            own: Number of senders of an arm's setpoints in this session.

        Raises:
            SessionError: There are more senders.
        """
        for arm in self._graph.namespaces:
            topic = SLAVE_SETPOINT_JS.of_arm(arm).name
            if self._observer.senders(topic) > own:
                raise SessionError(
                    f"another session sends {topic} on ROS domain {self._env['ROS_DOMAIN_ID']}: "
                    "end it, set ROS_DOMAIN_ID to another domain, or unset it to get a free one"
                )

    def _await_operator(self) -> None:
        """Wait until the hand moves. After some time the hand moves even if no arm follows."""
        hands = [m.name for m in self._graph.members if m.stage.name == HAND]
        operators = [name for name in hands if name in self._observer.statuses]
        while not all(self._observer.statuses[m].number("has_begun") for m in operators):
            self._observer.listen(0.1)
            self._check()

    def _watch(self) -> None:
        begin = time.monotonic()
        shown = 0
        while (elapsed := time.monotonic() - begin) < self._duration:
            self._observer.listen(min(0.1, self._duration - elapsed))
            self._check()
            if self._task_end is not None and self._task_end.is_there():
                self.say("the task is finished")
                return
            if int(elapsed) > shown:
                shown = int(elapsed)
                self.say(f"{shown:3d}/{self._duration:g} s  {self._line()}")

    def _check_alive(self) -> None:
        self._interrupt.check()
        for child in self._children.values():
            child.check()

    def _obey(self) -> None:
        """Execute the pressed keys, except the stop key, whose stop is sent at once in another thread."""
        while self._keys.waiting:
            if self._keys.waiting.popleft() != "e":
                continue
            self._observer.press(is_pressed=False)
            try:
                with RemoteControl(int(self._env["ROS_DOMAIN_ID"])) as operator:
                    for line in operator.go_on():
                        self.say(line)
            except SessionError as error:
                self.say(str(error))

    def _check(self) -> None:
        """Check that no signal came, all processes run and all nodes report."""
        self._interrupt.check()
        self._obey()
        self._beside.check()
        if time.monotonic() - self._ready < _ALONE:
            self._insist_on_one_owner(1)
        for crew in self.crews:
            for name in [name for name in crew if name in self._children]:
                child = self._children[name]
                child.check()
                self._check_reports(child, crew[name])

    def _check_reports(self, child: Child, nodes: tuple[str, ...]) -> None:
        for name in nodes:
            status = self._observer.statuses.get(name)
            heard = max(status.arrival, self._ready) if status else time.monotonic()
            silence = time.monotonic() - heard
            if silence > SILENCE:
                reason = f"{name} hangs: it has not reported for {silence:.0f} s"
                raise SessionError(reason + child.last_words())

    def _line(self) -> str:
        """One line about the state of the session."""
        statuses = self._observer.statuses
        refused = sum(status.number("refused") for status in statuses.values())
        parts = []
        for member in self._graph.members:
            is_arm = member.stage.name == self._graph.chain()[-1][0]
            if is_arm and member.name in statuses:
                parts += self._slave_line(member.arm, statuses[member.name])
        parts.append(f"refused {refused:.0f}")
        if self._beside.ended:
            parts.append(f"ended beside {self._beside.ended}")
        warnings = [f"{n}: {s.message}" for n, s in statuses.items() if s.level >= WARNING]
        return ", ".join(parts) + "".join(f"; {warning}" for warning in warnings)

    @staticmethod
    def _slave_line(arm: str, slave: Status) -> list[str]:
        return [
            f"{arm or 'slave'} {slave.number('rate_hz'):.0f} Hz",
            f"late {slave.number('late'):.0f}",
            f"missed {slave.number('missed'):.0f}",
            f"dropped {slave.number('dropped_time_ms'):g} ms",
            f"master to slave {slave.number('delay_ms.median'):.1f} ms (p99 {slave.number('delay_ms.p99'):.1f})",
        ]

    def say(self, text: str) -> None:
        """Print a line on the console."""
        with suppress(OSError):  # a closed terminal must not block the end
            self._console.print(printable(text), highlight=False, markup=False, soft_wrap=True)

    def _stop(self) -> list[str]:
        """End all nodes in order, whatever signals come; returns texts about problems."""
        recorder = self._children.pop(RECORDER_NAME, None)
        failures = end_all(self._children.values())
        self._beside.close()
        return failures + end_all([recorder] if recorder else [])


class _Progress:
    """Progress that processes report while they start."""

    def __init__(self, children: Mapping[str, Child | Starter]) -> None:
        self._children = children
        self._seen: dict[str, str] = {}
        self._begin = self._last = self._told = time.monotonic()

    def since_begin(self) -> float:
        """Time since the processes were started [s]."""
        return time.monotonic() - self._begin

    def news(self) -> list[str]:
        """Lines about processes that take long, printed at intervals."""
        seen = {name: child.doing for name, child in self._children.items()}
        now = time.monotonic()
        if seen != self._seen:
            self._seen, self._last = seen, now
        if now - self._told < _NEWS_PERIOD:
            return []
        self._told = now
        return [f"{name}: {doing}" for name, doing in seen.items() if "compiling" in doing]

    def age(self) -> float:
        """Time since the last progress of any process [s]."""
        return time.monotonic() - self._last


def session_parameters(
    configuration: Configuration,
    out: str,
    namespace: str = "",
    *,
    starts_recorder: bool = True,
    priority: int | None = None,
) -> dict[str, Any]:
    """Parameters of all nodes, as the content of a ROS 2 parameter file.

    Every node is named with its namespace. A port that is not fed by the topic of its own name has an entry in the
    node's ``links``.

    Args:
        configuration: The session.
        out: Directory of the recording; empty: a directory in bags/ named by the time.
        namespace: Namespace of all nodes, without leading and trailing slash.
        priority: Priority of the loops; None: as configured.
        starts_recorder: Whether the recorder configures and activates itself.
    """
    content, graph = configuration.content(), configuration.graph
    session = content.pop(SESSION)
    shared = {k: v for k, v in session["ros__parameters"].items() if k.startswith("real_time.")}
    if priority is not None:
        shared["real_time.priority"] = priority
    for node in content.values():
        node["ros__parameters"] |= shared
    for member in graph.members:
        if links := link_texts(graph, member):
            content[member.name]["ros__parameters"]["links"] = links
    frames = {"configuration": configuration.text(), "real_time.priority": 0}
    recorder = content[RECORDER_NAME]["ros__parameters"]
    recorder |= {"out": out, "scenario": configuration.scenario, **frames}
    content[FRAMES_NAME] = {"ros__parameters": shared | frames}
    records = [topic for one in processes_beside(configuration).values() for topic in one.records]
    recorder["also"] = list(dict.fromkeys([*recorder["also"], *records]))
    if not starts_recorder:
        recorder["autostart"] = False
    place = f"/{namespace}" if namespace else ""
    named = {f"{place}/{name}": node for name, node in content.items()}
    return {SESSION: session, **named}
