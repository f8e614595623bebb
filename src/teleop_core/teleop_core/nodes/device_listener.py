"""Device listener: where a device says that it is, for whoever looks before a session."""

import time
from typing import Any

from teleop_core.base.errors import SessionError
from teleop_core.chain.master.master_bridge import POSE_MESSAGES
from teleop_core.graph.topics import Kind, Topic
from teleop_core.kernels.geometry import Array
from teleop_core.middleware.ros_messages import read_message
from teleop_core.nodes.guest import Guest
from teleop_core.nodes.master_bridge import pose_of
from teleop_core.nodes.streams import Subscription

PATIENCE = 5.0
"""Time in which the topic must be found, and a message must come [s]."""


class DeviceListener(Guest):
    """Listener to one device.

    Args:
        topic: Where the device says its poses, or its joints.
        domain: ROS domain.
        patience: Time in which the topic must be found [s].

    Attributes:
        message: Type of the messages.

    Raises:
        SessionError: There is no such topic, or none of a device; the text names those of devices.
    """

    def __init__(self, topic: str, domain: int, patience: float = PATIENCE) -> None:
        super().__init__("teleop_map_device", domain, start_parameter_services=False)
        self._subscription: Subscription | None = None
        try:
            self.topic = topic if topic.startswith("/") else f"/{topic}"
            self.message = self._find(domain, patience)
            heard = Topic(self.topic, Kind.POSE, message=self.message)
            self._subscription = Subscription(self, heard, self.topic, 1)
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Leave the device as it is."""
        if self._subscription is not None:
            self._subscription.close()
        super().close()

    def place(self) -> Array:
        """Where the stylus is now, (3,) in the device's unit.

        Raises:
            SessionError: No message came.
        """
        found: Array = pose_of(self._latest())[:3]
        return found

    def joints(self) -> dict[str, float]:
        """Where the joints of a jointed device are now [rad or m], by their names.

        Raises:
            SessionError: No message came, or one without a position for each name.
        """
        message = self._latest()
        if not message.name or len(message.name) != len(message.position):
            raise SessionError(f"{self.topic} does not say one position for each name")
        return dict(zip(message.name, message.position, strict=True))

    def _latest(self) -> Any:
        """Newest message; waits for the first one that comes from now on."""
        newest, end = self._newest(), time.monotonic() + PATIENCE
        while (later := self._newest()) is not None or newest is None:
            newest = later if later is not None else newest
            if newest is None:
                if time.monotonic() > end:
                    raise SessionError(f"{self.topic} is there, but silent: does the driver run?")
                self._wait(0.1)
        return newest

    def _wait(self, seconds: float) -> None:
        assert self._subscription is not None
        self._subscription.wait(seconds)

    def _newest(self) -> Any:
        """Message that waits, if any; of those before it nothing is kept."""
        assert self._subscription is not None
        taken = self._subscription.take()
        return None if taken is None else read_message(taken.data, self._subscription.type)

    def _find(self, domain: int, patience: float) -> str:
        end = time.monotonic() + patience
        while True:
            known = dict(self.ros.get_topic_names_and_types())
            found = [kind for kind in known.get(self.topic, ()) if kind in POSE_MESSAGES]
            if found:
                return found[0]
            if time.monotonic() > end:
                break
            time.sleep(0.05)
        others = sorted(name for name, kinds in known.items() if set(kinds) & set(POSE_MESSAGES))
        what = f"is {', '.join(known[self.topic])}" if self.topic in known else "is not there"
        raise SessionError(
            f"{self.topic} {what} on ROS domain {domain}; topics of devices: "
            f"{', '.join(others) or 'none'}"
        )
