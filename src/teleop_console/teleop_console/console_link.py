"""Console link: access of the page to a live session through topics and services.

The link reads the slow copies of streams that their nodes send for displays (:mod:`teleop_core.nodes.display`). Without
copies it subscribes to the streams themselves, best effort and with a queue of one. In a session with a display the
page shows the slave with the delay of this display, as a simulated operator sees it.
"""

import math
import re
from contextlib import suppress
from pathlib import Path
from types import MappingProxyType
from typing import Any

from std_srvs.srv import Trigger

from teleop_console.console_streams import SILENCE, Hand, NewestSample, now_of
from teleop_console.link import ArmView, ParameterInfo, Parameters, Setting, ShownArm, View
from teleop_console.parameter_client import ParameterClient, ParameterEvents, call
from teleop_console.picture_streams import PictureStreams
from teleop_core.bags.messages import read_numbers, read_reports
from teleop_core.bags.recording import MARKS
from teleop_core.base.errors import ParameterError, SessionError
from teleop_core.graph.graph import RECORDER_NAME
from teleop_core.graph.signals import PHASES
from teleop_core.graph.topics import OPERATION, SLAVE_OPERATION, TELEOP_STATE
from teleop_core.kernels.geometry import Array
from teleop_core.middleware.platform import Platform, PlatformEndedError
from teleop_core.middleware.ros import ROS
from teleop_core.nodes.display import SEEN
from teleop_core.nodes.observer import WARNING, ReportReader
from teleop_core.nodes.operation import StopButton
from teleop_core.nodes.streams import Subscription
from teleop_core.robots import load_robot_set
from teleop_core.robots.robot import Robot
from teleop_core.slave.operation import operation_text

PATIENCE = 5.0
"""Time limit for the discovery and the answer of an arm [s]."""
_LIST, _SPLIT = "/list_parameters", "/split"
_MARKS = 100  # largest number of marks in memory
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,99}")
_HEARTBEAT = "operation.heartbeat"


class LiveLink(ReportReader):
    """A :class:`~teleop_console.link.SessionLink` to a running session.

    Args:
        domain: ROS domain of the session.
        title: Name of the session.
        patience: Time in which an arm must be found [s].
        button: Stop button that may have been pressed before the arm was found; None for a new button.
        platform: Platform of the session.

    Raises:
        SessionError: The domain has no arm, or an arm does not report its robot.
    """

    is_live = True

    def __init__(
        self,
        domain: int,
        title: str = "",
        patience: float = PATIENCE,
        button: StopButton | None = None,
        platform: Platform = ROS,
    ) -> None:
        super().__init__(domain, "teleop_console", button, platform, start_parameter_services=False)
        self.domain = domain
        self._executor = self.platform.executor()
        self._executor.add_node(self.ros)
        self._is_closed = False
        self._thread = self.platform.thread("console link", self._spin)
        self._thread.start()
        self._lock, self._pressing = self.platform.lock(), self.platform.lock()
        self._clients: dict[str, Any] = {}
        self._client, self._events = ParameterClient(self), ParameterEvents(self)
        self._known: dict[tuple[str, str], ParameterInfo] = {}
        self._runs, self._is_pressed = 0, False
        try:
            self._find(patience)
        except BaseException:
            self.close()
            raise
        self.title = title or str(self._value(self._recorder(), "scenario") or "session")

    def close(self) -> None:
        """Disconnect; the session keeps running."""
        self._is_closed = True  # must be first, because an executor that is shut down while it spins raises an error
        self._executor.wake()
        self._thread.join(PATIENCE)
        self._executor.shutdown()
        self.platform.shutdown()
        with suppress(Exception):  # the middleware may be shut down already
            self.ros.destroy_node()

    def _spin(self) -> None:
        with suppress(PlatformEndedError):
            while not self._is_closed:
                self._executor.spin_once(timeout_sec=0.1)

    # -- finding ---------------------------------------------------------------------------------

    def _find(self, patience: float) -> None:
        """Find arms and their robots."""
        end, suffix, names = now_of(self) + patience, f"/{SLAVE_OPERATION.name}", set[str]()
        while not names:
            topics = self.ros.get_topic_names_and_types()
            names = {name.removesuffix(suffix).strip("/") for name, _ in topics if name.endswith(suffix)}
            if not names and now_of(self) > end:
                raise SessionError(
                    f"no arm answers on ROS domain {self.domain}; `teleop live` prints the domain of its "
                    "session; give it with --domain N"
                )
            self.platform.sleep(0.02)
        self.arms = tuple(ShownArm(name, self._robot(name)) for name in sorted(names))
        self._seen = {arm.name: [NewestSample(self, t, arm) for t in SEEN] for arm in self.arms}
        told = {arm.name: [t.of_arm(arm.name) for t in (SLAVE_OPERATION, TELEOP_STATE)] for arm in self.arms}
        self._told = {arm: [Subscription(self, t, f"/{t.name}") for t in topics] for arm, topics in told.items()}
        self._marks = Subscription(self, MARKS, f"/{self._recorder()}/marks", _MARKS)
        self._hands = {arm.name: Hand(self, arm.name) for arm in self.arms}
        self._pictures = PictureStreams(self)
        self._view = View(arms={arm.name: ArmView() for arm in self.arms})
        self._begun = self._heard = now_of(self)

    def _robot(self, arm: str) -> Robot:
        slave = "/".join(filter(None, (arm, "slave")))
        values = self._client.values(slave, ["robot", "geometry"])  # a slave that does not answer counts as no RCRT-1
        told = self._client.values(slave, [_HEARTBEAT])  # a slave of another program may lack this parameter
        self.has_heartbeat = self.has_heartbeat or bool(told.get(_HEARTBEAT))
        geometry = values.get("geometry")
        texts = tuple(map(str, geometry)) if isinstance(geometry, tuple) else ()
        return load_robot_set(str(values.get("robot", "rcrt1")), texts)

    def _recorder(self) -> str:
        """Recorder of the session, in its namespace."""
        services, end = self.ros.get_service_names_and_types(), f"/{RECORDER_NAME}{_SPLIT}"
        found = (name.removesuffix(_SPLIT) for name, _ in services if name.endswith(end))
        return next(found, RECORDER_NAME).strip("/")

    def _value(self, node: str, name: str) -> Setting | None:
        try:
            return self._client.values(node, [name]).get(name)
        except SessionError:
            return None

    # -- seeing ----------------------------------------------------------------------------------

    def view(self) -> View:
        """Newest data of the session."""
        with self._lock:
            view, now = self._view, now_of(self)
            for arm in self.arms:
                taken = [seen.take() for seen in self._seen[arm.name]]
                if any(taken):
                    self._heard = now
                for seen in reversed(self._seen[arm.name]):  # search the display's topic first, which is the last in
                    # this order
                    seen.show(view.arms[arm.name])
                self._hear(arm, view.arms[arm.name])
            self._insist(view)
            self._hear_nodes(view)
            self._hear_marks(view)
            view.pictures = self._pictures.take()
            view.time, view.age = now - self._begun, now - self._heard
            # frame rate of the display's topic, which is the last one
            view.display = self._seen[self.arms[0].name][-1].rhythm()
            view.is_fresh = view.age < SILENCE
            return view

    def _hear(self, arm: ShownArm, view: ArmView) -> None:
        operation, state = self._told[arm.name]
        while (taken := operation.take()) is not None:
            found = read_numbers(taken.data, OPERATION)
            if isinstance(found, tuple):
                view.operation = dict(zip(OPERATION, map(float, found[1]), strict=True))
                view.operation_text = operation_text(view.operation, arm.robot.joint_names)
        while (taken := state.take()) is not None:
            found = read_numbers(taken.data, TELEOP_STATE.columns)
            if isinstance(found, tuple):
                view.state = dict(zip(TELEOP_STATE.columns, map(float, found[1]), strict=True))

    def _hear_marks(self, view: View) -> None:
        while (taken := self._marks.take()) is not None:
            with suppress(ValueError):  # the bytes may not be a report
                for mark in read_reports(taken.data):
                    ago = 1e-9 * (self.platform.time_ns() - mark.stamp_ns)
                    view.marks = (*view.marks, (now_of(self) - self._begun - ago, mark.message))[-_MARKS:]

    def _hear_nodes(self, view: View) -> None:
        if not self.take():
            return
        named = (s for n, s in self.statuses.items() if n.rsplit("/", 1)[-1] == RECORDER_NAME)
        recorder = next(named, None)
        if recorder is not None and recorder.values.get("out"):
            is_recording = recorder.number("is_recording") > 0
            view.recording = Path(recorder.values["out"]) if is_recording else None
        view.news = tuple(f"{name}: {s.message}" for name, s in self.statuses.items() if s.level >= WARNING)
        slave = self.statuses.get("/".join(filter(None, (self.arms[0].name, "slave"))))
        if slave is not None:
            unknown = "delay_ms.median" not in slave.values
            median, worst = (slave.number(f"delay_ms.{w}") * 1e-3 for w in ("median", "p99"))
            view.delay = (math.nan, math.nan) if unknown else (median, worst)
            view.rate = slave.number("rate_hz") or math.nan
            ticks = slave.number("phase_ticks")
            view.phases = {name: 1e-6 * slave.number(f"phase_us.{name}") / ticks for name in PHASES if ticks}

    # -- commanding ------------------------------------------------------------------------------

    def command(self, word: str, arm: str = "") -> tuple[bool, str]:
        """Send a state command; returns whether it was accepted, and the arm's answer."""
        return self._trigger("/" + "/".join(filter(None, (arm, "slave", word))))

    def _trigger(self, name: str) -> tuple[bool, str]:
        with self._lock:
            if name not in self._clients:
                self._clients[name] = self.ros.create_client(Trigger, name)
        try:
            answer = call(self.platform, self._clients[name], Trigger.Request(), PATIENCE)
        except SessionError as error:
            return False, str(error)
        return bool(answer.success), str(answer.message)

    def press(self, *, is_pressed: bool = True) -> None:
        """Press or release the emergency stop of all arms.

        The stop is repeated at every :meth:`view` until all arms have confirmed it.
        """
        with self._pressing:
            self._is_pressed = is_pressed
            self._button.say(is_pressed=is_pressed)

    def _insist(self, view: View) -> None:
        """Repeat a stop that an arm has not confirmed, unless the stop was released."""
        with self._pressing:
            confirmed = all(arm.operation.get("is_stopped") for arm in view.arms.values())
            self._is_pressed = self._is_pressed and not confirmed
            if self._is_pressed:
                self._button.say(is_pressed=True)

    def parameters(self) -> Parameters:
        """All parameters of all nodes, read from the nodes again."""
        found: dict[tuple[str, str], ParameterInfo] = {}
        services = [name for name, _ in self.ros.get_service_names_and_types()]
        for node in sorted(name.removesuffix(_LIST).strip("/") for name in services if name.endswith(_LIST)):
            with suppress(SessionError):  # the session may be ending
                found |= {(node, name): info for name, info in self._client.read(node).items()}
        self._known = found
        return MappingProxyType(found)

    def changes(self) -> dict[tuple[str, str], Setting]:
        """Parameters that any source has changed since the last call, by node and name."""
        return self._events.take()

    def change(self, node: str, name: str, value: Setting) -> str:
        """Set a parameter; returns the reason of a refusal, else an empty text."""
        return self._client.change(node, name, value)

    def hold(self, arm: str, pose: Array) -> None:
        """Command the stylus to a pose (7,) in the master's base."""
        self._hands[arm].hold(pose)

    def let_go(self, arm: str) -> None:
        """Release the stylus. No message is sent, because silence releases the stylus."""

    def press_button(self, arm: str, name: str) -> None:
        """Press and release the ``fixture`` or ``mode`` button of the stylus."""
        self._hands[arm].press(name)

    def close_jaw(self, share: float) -> None:
        """Set the closed share of the jaw for all hands: 0 is open, 1 is closed."""
        for hand in self._hands.values():
            hand.close_jaw(share)

    def mark(self) -> tuple[bool, str]:
        """Set a mark at the present time; returns whether the recorder wrote it, and its text."""
        return self._trigger(f"/{self._recorder()}/mark")

    def save(self, name: str) -> Path:
        """Close the recording under a name and begin the next one; returns the path of the closed recording.

        Raises:
            ParameterError: The name is not a plain file name, or a recording has this name.
            SessionError: The recorder refuses, or does not answer.
        """
        recording = self._view.recording
        if recording is None:
            raise SessionError("nothing is being recorded")
        if not _NAME.fullmatch(name):
            raise ParameterError("name", name, "letters, digits, '.', '_' and '-', no more than 100")
        wanted = recording.with_name(name)
        if wanted.exists():
            raise ParameterError("name", name, f"a new name; {wanted} exists already")
        is_done, text = self._trigger(f"/{self._recorder()}{_SPLIT}")
        if not is_done:
            raise SessionError(text)
        closed = Path(text.split(" is closed; ")[0])
        try:
            closed.rename(wanted)
        except OSError as error:
            raise SessionError(f"{closed} is closed, but could not be renamed to {name}: {error}") from error
        self._runs += 1
        with self._lock:
            self._view.run = self._runs
        return wanted
