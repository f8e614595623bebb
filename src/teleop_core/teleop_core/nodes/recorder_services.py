"""Services of the recorder: start, stop, split and mark, by anybody who may call a Trigger."""

from collections.abc import Callable
from typing import Protocol

from std_srvs.srv import Trigger

from teleop_core.base.errors import RecordingError, SessionError
from teleop_core.middleware.world import Owner


class Recorder(Protocol):
    """What the services ask for; each answers in one line.

    Raises:
        SessionError: It cannot be done in the present state.
        RecordingError: The recording could not be written.
    """

    def start_recording(self) -> str:
        """Record again, in a new directory."""

    def stop_recording(self) -> str:
        """Close the recording; what comes is thrown away until the next start."""

    def split_recording(self) -> str:
        """Close the recording and go on in a new directory."""

    def mark_recording(self) -> str:
        """Note that something happens now."""


def serve(owner: Owner, recorder: Recorder, fail: Callable[[str, bool], None]) -> None:
    """Offer the services below the node's name, in its executor.

    Args:
        owner: Whose they are.
        recorder: Who does it.
        fail: Told why the recording cannot be written any more.
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
