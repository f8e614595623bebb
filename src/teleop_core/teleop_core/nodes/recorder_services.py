"""Services of the recorder: start, stop, split and mark; any client can call them, since they are Triggers."""

from collections.abc import Callable
from typing import Protocol

from std_srvs.srv import Trigger

from teleop_core.base.errors import RecordingError, SessionError
from teleop_core.middleware.platform import Owner


class Recorder(Protocol):
    """Functions behind the services; each returns one line of text.

    Raises:
        SessionError: The function is not possible in the current state.
        RecordingError: The recording could not be written.
    """

    def start_recording(self) -> str:
        """Record again, in a new directory."""

    def stop_recording(self) -> str:
        """Close the recording; messages are discarded until the next start."""

    def split_recording(self) -> str:
        """Close the recording and continue in a new directory."""

    def mark_recording(self) -> str:
        """Record a mark with the current time."""


def serve(owner: Owner, recorder: Recorder, fail: Callable[[str, bool], None]) -> None:
    """Offer the services below the node's name, in its executor.

    Args:
        owner: Node that owns the services.
        recorder: Recorder that executes them.
        fail: Called with the reason when the recording cannot be written any more.
    """
    actions = {
        "start": recorder.start_recording,
        "stop": recorder.stop_recording,
        "split": recorder.split_recording,
        "mark": recorder.mark_recording,
    }

    def answering(action: Callable[[], str]) -> Callable[[object, Trigger.Response], object]:
        def answer(request: object, response: Trigger.Response) -> object:
            try:
                response.message, response.success = action(), True
                owner.ros.get_logger().info(response.message)
            except SessionError as error:
                response.message = str(error)
            except RecordingError as error:
                response.message = str(error)
                fail(response.message, True)
            return response

        return answer

    for name, action in actions.items():
        owner.ros.create_service(Trigger, f"~/{name}", answering(action))
