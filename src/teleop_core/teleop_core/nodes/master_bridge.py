"""Node ``master_bridge``: a real device instead of ``haptic_master``."""

from typing import Any

import numpy as np

from teleop_core.graph.topics import MASTER_BUTTONS, MASTER_MEASURED_CP, MASTER_SERVO_CF, Kind, Quality, Topic
from teleop_core.hand.master.master_bridge import RATE_MESSAGE, MasterBridgeParameters
from teleop_core.middleware.ros_messages import read_message
from teleop_core.nodes.news import Trouble
from teleop_core.nodes.streams import Subscription, message_type
from teleop_core.nodes.ticking import TickingNode

_WAITING = 20  # number of the device's messages that are queued while the loop is late
_BUTTONS_AGAIN_NS = 20_000_000  # button states are sent again after this time, since silent buttons count as lost


class MasterBridgeNode(TickingNode):
    """Passes on the device's poses and buttons, and sends it the newest force.

    For each valid pose, the node publishes ``master/measured_cp`` with the time of the pose as stamp. Without valid
    poses it publishes nothing; the slave then holds its position. The buttons are repeated as long as messages of the
    device come.
    """

    def setup(self, parameters: MasterBridgeParameters) -> None:
        """Make the stage, open its topics and the topics of the device."""
        super().setup(parameters)
        p = parameters
        heard = Topic(p.pose_topic, Kind.POSE, message=p.pose_message)
        self._poses = Subscription(self, heard, heard.name, _WAITING)
        self._presses: Subscription | None = None
        if p.buttons_topic:
            pressed = Topic(p.buttons_topic, Kind.BUTTONS, quality=MASTER_BUTTONS.quality)
            self._presses = Subscription(self, pressed, pressed.name, _WAITING)
        self._forces = None
        if p.force_topic:
            told = Topic(p.force_topic, Kind.WRENCH, quality=Quality.STREAM)
            self._forces, self._wrench = self.open_publisher(told), message_type(told.ros_type)()
        self._trouble = Trouble(self, "follows the device")
        self._pose_out = self.ports.output(MASTER_MEASURED_CP)
        self._buttons_out, self._said_ns = self.ports.output(MASTER_BUTTONS), 0

    def teardown(self) -> None:
        """Close what :meth:`setup` opened."""
        self._poses.close()
        if self._presses is not None:
            self._presses.close()
        super().teardown()

    def step(self, tick_ns: int) -> None:
        """Pass on the device's messages, and send it the force of the newest tick."""
        if self.loop is not None and tick_ns != self.loop.newest_ns:
            return  # of several late ticks, the newest is enough
        now_ns = self.epoch_ns + tick_ns
        with self.lock:
            is_new = self._listen()
            is_heard = self.stage.is_heard(self.platform.time_ns())
            force = self.stage.force(self.input(MASTER_SERVO_CF).age(), self.platform.time_ns())
        if is_new or (is_heard and now_ns - self._said_ns >= _BUTTONS_AGAIN_NS):
            self.ports.send_now(self._buttons_out, now_ns)
            self._said_ns = now_ns
        self._trouble.tell(self.stage.concerns())
        if self._forces is not None:
            push = self._wrench.wrench.force
            push.x, push.y, push.z = force.tolist()
            stamp = self._wrench.header.stamp
            stamp.sec, stamp.nanosec = divmod(now_ns, 1_000_000_000)
            self._forces.publish(self._wrench)

    def _listen(self) -> bool:
        """Read the received messages; return whether a button was pressed or released."""
        while (taken := self._poses.take()) is not None:
            message = read_message(taken.data, self._poses.type)
            has_stamp = self.parameters.pose_stamps == "header" and hasattr(message, "header")
            stamp_ns = _nanoseconds(message.header.stamp) if has_stamp else taken.sent_ns
            if self._hear(message, stamp_ns):
                self.ports.send_now(self._pose_out, stamp_ns)
        is_new = False
        while self._presses is not None and (taken := self._presses.take()) is not None:
            before = self.stage.signals[MASTER_BUTTONS.field].copy()
            buttons = read_message(taken.data, self._presses.type).buttons
            is_sound = self.stage.press(buttons)
            after = self.stage.signals[MASTER_BUTTONS.field]
            is_new = is_new or (is_sound and not np.array_equal(before, after))
        return is_new

    def _hear(self, message: Any, stamp_ns: int) -> bool:
        now_ns = self.platform.time_ns()
        if self.parameters.pose_message == RATE_MESSAGE:
            return bool(self.stage.hear_joy(message.axes, message.buttons, stamp_ns, now_ns))
        if self.parameters.says_joints:
            return bool(self.stage.hear_joints(message.name, message.position, stamp_ns, now_ns))
        return bool(self.stage.hear(pose_of(message), stamp_ns, now_ns))

    def values(self) -> dict[str, str]:
        """Number of refused poses of the device."""
        refused = self.stage.refused.items()
        return {f"refused.device.{reason}": str(count) for reason, count in refused}


def pose_of(message: Any) -> Any:
    """Pose (7,) in a PoseStamped, TransformStamped or Pose message, in the message's unit."""
    pose = getattr(message, "pose", None) or getattr(message, "transform", message)
    place = pose.position if hasattr(pose, "position") else pose.translation
    turn = pose.orientation if hasattr(pose, "orientation") else pose.rotation
    return np.array([place.x, place.y, place.z, turn.w, turn.x, turn.y, turn.z])


def _nanoseconds(stamp: Any) -> int:
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)
