"""Remote control: stops and commands the arms of a ROS domain, and reports their states."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from std_srvs.srv import Trigger

from teleop_core.bags.messages import read_reports
from teleop_core.base.errors import SessionError
from teleop_core.graph.operation import State
from teleop_core.graph.topics import OPERATION, SLAVE_OPERATION
from teleop_core.middleware.platform import Platform
from teleop_core.middleware.ros import ROS
from teleop_core.nodes.guest import Guest
from teleop_core.nodes.operation import StopButton
from teleop_core.nodes.streams import Subscription
from teleop_core.slave.operation import operation_text
from teleop_core.slave.operation.states import AT_REST_ONLY

_PERIOD = 0.01
"""Period at which a stop is repeated until every arm has answered [s]."""


@dataclass
class ReportedArm:
    """Last reported state of an arm.

    Attributes:
        values: Numbers of ``slave/operation`` by name; empty before the first report.
        text: The state as text.
        stopped_after: Time from the first stop message to the report that the stop is in force [s]; negative before
            that report.
    """

    values: dict[str, float] = field(default_factory=dict)
    text: str = ""
    stopped_after: float = -1.0


class RemoteControl(Guest):
    """Remote control of the arms of one ROS domain.

    Args:
        domain: ROS domain.
        patience: Longest time for the discovery of an arm, and for its answer [s].
        platform: Platform of the session.

    Attributes:
        domain: ROS domain.
        arms: State of every discovered arm, by its namespace.
    """

    def __init__(self, domain: int, patience: float = 3.0, platform: Platform = ROS) -> None:
        super().__init__("teleop_remote_control", domain, platform)
        self.domain, self._patience = domain, patience
        self.arms: dict[str, ReportedArm] = {}
        self._executor = self.platform.executor()
        self._executor.add_node(self.ros)
        self._button = StopButton(self)
        self._reports: dict[str, Subscription] = {}

    def close(self) -> None:
        """Close the remote control; the arms stay in their states."""
        self._executor.shutdown()
        super().close()

    def _now(self) -> float:
        return 1e-9 * self.platform.monotonic_ns()

    def look(self) -> dict[str, ReportedArm]:
        """Wait until each arm has reported, and return the states by namespace.

        Raises:
            SessionError: There is no arm on this domain.
        """
        self._until(lambda: bool(self.arms) and all(arm.values for arm in self.arms.values()), must=False)
        if not self.arms:
            raise SessionError(
                f"no arm answers on ROS domain {self.domain}; `teleop live` prints the domain of its "
                "session; give it with --domain N"
            )
        return self.arms

    def stop(self) -> dict[str, ReportedArm]:
        """Press the emergency stop until every arm has reported that the stop is in force and that the arm rests.

        Raises:
            SessionError: There is no arm, or an arm did not answer. The stop was sent nevertheless.
        """
        begin = self._now()

        def is_stopped() -> bool:
            self._button.say(is_pressed=True)
            for arm in self.arms.values():
                if arm.values.get("is_stopped") and arm.stopped_after < 0.0:
                    arm.stopped_after = self._now() - begin
            return bool(self.arms) and all(
                arm.values.get("is_stopped") and arm.values["rest_time"] > 0.0 for arm in self.arms.values()
            )

        if not self._until(is_stopped, must=False):
            missing = [name or "the arm" for name, a in self.arms.items() if not a.stopped_after >= 0]
            what = f"{', '.join(missing)} did not confirm" if missing else "no arm confirmed"
            raise SessionError(f"{what} the stop on ROS domain {self.domain}")
        return self.arms

    def go_on(self) -> list[str]:
        """Reset and enable, or resume, every arm; returns the arms' answers.

        An arm that was stopped before it was homed is then homed. The method waits for an arm whose stop is being
        released. An arm whose stop stays pressed answers with the pressed buttons.
        """
        self.look()
        self._until(lambda: not any(arm.values["is_pressed"] for arm in self.arms.values()), must=False)
        told = []
        for arm, state in self.arms.items():
            words = ["resume"] if state.values["state"] == State.PAUSED else ["reset", "enable"]
            if not state.values["is_homed"] and "enable" in words:
                words.append("home")
            told += [self._command_at_rest(word, arm) for word in words]
        return told

    def _command_at_rest(self, name: str, arm: str) -> str:
        """Repeat a command until the arm rests and accepts it; returns the arm's answer."""
        deadline = self._now() + self._patience
        while (answer := self.command(name, arm)[1]).endswith(AT_REST_ONLY):
            if self._now() > deadline:
                break
            self.listen()
        return answer

    def command(self, name: str, arm: str = "") -> tuple[bool, str]:
        """Send a state command to an arm; returns whether it was accepted, and the arm's answer.

        Args:
            name: One of :data:`~teleop_core.slave.operation.states.COMMANDS`, or ``release``, which overrides the stop
                buttons that are pressed.
            arm: Namespace of the arm.

        Raises:
            SessionError: The arm does not answer.
        """
        service = f"/{arm}/slave/{name}" if arm else f"/slave/{name}"
        client = self.ros.create_client(Trigger, service)
        self._until(client.service_is_ready, f"{service} on ROS domain {self.domain}")
        future = client.call_async(Trigger.Request())
        self._until(future.done, f"an answer of {service}")
        answer: Any = future.result()
        return answer.success, answer.message

    def _until(self, condition: Callable[[], Any], what: str = "", *, must: bool = True) -> bool:
        """Wait until a condition is true, at most for the time ``patience``."""
        deadline = self._now() + self._patience
        while not condition():
            if self._now() > deadline:
                if must:
                    raise SessionError(f"no {what}")
                return False
            self.listen()
        return True

    def listen(self) -> None:
        """Read the received reports; look for arms."""
        for name, kinds in self.ros.get_topic_names_and_types():
            if name.endswith(f"/{SLAVE_OPERATION.name}") and name not in self._reports and kinds:
                self._reports[name] = Subscription(self, SLAVE_OPERATION, name)
                self.arms[name.removesuffix(SLAVE_OPERATION.name).strip("/")] = ReportedArm()
        for name, reports in self._reports.items():
            arm = self.arms[name.removesuffix(SLAVE_OPERATION.name).strip("/")]
            while (taken := reports.take()) is not None:
                _note(arm, taken.data)
        self._executor.spin_once(timeout_sec=_PERIOD)


def _note(arm: ReportedArm, data: bytes) -> None:
    """Store a report of an arm; bytes that are not a report are ignored."""
    try:
        report = read_reports(data)[0]
        values = {name: float(report.values[name]) for name in OPERATION}
    except (ValueError, KeyError, IndexError):
        return
    arm.values = values
    arm.text = operation_text(values, tuple(report.values.get("joints", "").split()))
