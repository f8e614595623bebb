"""CRTK slave: motion commands and further measurements of a slave, in addition to its streams.

:class:`~teleop_core.slave.motion_commands.MotionCommands` decides which command moves the arm, and which motions are
allowed. This module converts messages to calls of that class. It works in the executor, which is fast enough for
commands that come once or some hundred times a second. Commands that come a thousand times a second go to
``slave/servo_jp`` and ``slave/servo_cp``.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from teleop_core.bags.messages import Refusal, layout, read_joints, read_values
from teleop_core.base.errors import TeleopError
from teleop_core.graph.operation import State
from teleop_core.graph.topics import SLAVE_MEASURED_CF, SLAVE_MEASURED_CP, SLAVE_SERVO_CP, SLAVE_SERVO_JP, Kind, Topic
from teleop_core.kernels.geometry import Array, framed_wrenches, pose_from_transform, transform_from_pose
from teleop_core.nodes.crtk import SINGLE, STREAMED, Condition, OperatingStateTopics, Refusals, is_installed
from teleop_core.nodes.outside import OutsideCommands
from teleop_core.nodes.sender import SECOND_NS
from teleop_core.nodes.streams import message_type, profile
from teleop_core.slave.motion_commands import Told
from teleop_core.slave.operation.states import Answer
from teleop_core.slave.ownership import Leader

_FRAME = SLAVE_MEASURED_CP.frame_id
MEASURED_CV = Topic("slave/measured_cv", Kind.TWIST, frame_id=_FRAME)
GOAL_JS = Topic("slave/goal_js", Kind.JOINTS, frame_id=_FRAME)
GOAL_CP = Topic("slave/goal_cp", Kind.POSE, frame_id=_FRAME)
BODY_CF = Topic("slave/body/measured_cf", Kind.WRENCH, frame_id="slave_tip")
SPATIAL_CF = Topic("slave/spatial/measured_cf", Kind.WRENCH, frame_id=_FRAME)
JACOBIAN = "slave/jacobian"
_JOINTS, _POSE = "sensor_msgs/msg/JointState", "geometry_msgs/msg/PoseStamped"
_TWIST, _EMPTY = "geometry_msgs/msg/TwistStamped", "std_msgs/msg/Empty"
_MATRIX = "std_msgs/msg/Float64MultiArray"
_PERIOD = 0.01  # period of the measurements while there is a reader [s]
_LOOK = 1.0  # time between two checks for readers [s]


class CrtkSlave:
    """Topics of CRTK that a slave offers in addition to its streams.

    Args:
        node: Node that owns the topics; its ``lock`` is held while the stage is read or commanded.
        stage: The slave.
    """

    def __init__(self, node: Any, stage: Any) -> None:
        self._node, self._stage, self._motion = node, stage, stage.motion
        self._motion.load()
        transform_from_pose(np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]), np.empty((4, 4)))
        self._names = stage.robot.joint_names
        self._refusals, self._source = Refusals(node), ""
        self._operation = stage.signals["slave_operation"]
        self._state: OperatingStateTopics | None = None
        if is_installed():
            self._state = OperatingStateTopics(
                node, "slave", stage.request, self._condition, self._motion.refusal_of_age
            )
        else:
            node.ros.get_logger().info("crtk_msgs is not installed: no slave/operating_state")
        self._subscriptions = [self._listen(*entry) for entry in self._commands()]
        streams = {name: command for name, _, _, command in self._commands()}
        led = {SLAVE_SERVO_JP: streams["interpolate_jp"], SLAVE_SERVO_CP: streams["interpolate_cp"]}
        takes = {topic: partial(self._take, topic.name.removeprefix("slave/"), led[topic]) for topic in led}
        self._outside = OutsideCommands(node, takes, self._refusals)
        self._measured = MeasuredTopics(node, stage)

    def note(self, stamp_ns: int) -> None:
        """Let the executor send a changed operating state with a stamp [ns]; called from the node's loop."""
        if self._state is not None:
            self._state.note(stamp_ns)

    def values(self) -> dict[str, str]:
        """The command that moves the arm, and the number of refused commands."""
        return {"motion": self._motion.source, **self._refusals.values()}

    def close(self) -> None:
        """Close the topics."""
        if self._state is not None:
            self._state.close()
        for subscription in self._subscriptions:
            self._node.ros.destroy(subscription)
        self._outside.close()
        self._measured.close()

    def _condition(self) -> Condition:
        state, is_homed, is_busy = self._operation[:3]
        return State(int(state)).name, bool(is_homed), bool(is_busy)

    # -- commands --------------------------------------------------------------------------------

    def _commands(self) -> list[tuple[str, str, bool, Callable[[Any], Told]]]:
        """For each command: name, message type, whether it is streamed, and the function that processes it."""
        motion, now = self._motion, self._node.platform.time_ns
        return [
            ("move_jp", _JOINTS, False, lambda m: self._locked(motion.move, self._of(m))),
            ("move_jr", _JOINTS, False, lambda m: self._locked(motion.move_by, self._of(m))),
            ("move_cp", _POSE, False, self._move_cp),
            ("hold", _EMPTY, False, lambda _: self._locked(motion.hold)),
            ("interpolate_jp", _JOINTS, True, lambda m: self._locked(motion.servo, self._of(m), now())),
            ("interpolate_cp", _POSE, True, self._interpolate_cp),
            (
                "servo_jr",
                _JOINTS,
                False,  # not streamed, because each command counts
                lambda m: self._locked(motion.servo_by, self._of(m), now()),
            ),
            ("servo_jv", _JOINTS, True, lambda m: self._locked(motion.drive_joints, self._of(m, "velocity"), now())),
            ("servo_cv", _TWIST, True, lambda m: self._locked(motion.drive_tip, _twist(m), now())),
        ]

    def _listen(self, name: str, kind: str, is_streamed: bool, command: Callable[[Any], Told]) -> Any:
        quality = STREAMED if is_streamed else SINGLE

        def take(message: Any) -> None:
            self._take(name, command, message)

        return self._node.ros.create_subscription(message_type(kind), f"slave/{name}", take, quality)

    def _take(self, name: str, command: Callable[[Any], Told], message: Any) -> None:
        if not self._node.is_at_work:
            self._refusals.add(f"slave/{name}", "refused: the node is not active")
            return
        try:
            stamp = message.header.stamp if hasattr(message, "header") else None
            stamp_ns = 0 if stamp is None else stamp.sec * SECOND_NS + stamp.nanosec
            refusal = self._locked(self._motion.refusal_of_age, stamp_ns, self._node.platform.time_ns())
            answer, text = refusal or command(message)
        except TeleopError as error:
            answer, text = Answer.REFUSED, f"refused: {error}"
        if answer not in {Answer.DONE, Answer.ALREADY}:
            self._refusals.add(f"slave/{name}", text)
        elif name != self._source:
            self._source = name
            self._node.ros.get_logger().info(f"slave/{name} commands the arm")

    def _locked(self, command: Callable[..., Told], *arguments: Any) -> Told:
        with self._node.lock:
            return command(*arguments)

    def _of(self, message: Any, part: str = "position") -> Array:
        """Joint values of a message, in the robot's order. A message without names must have this order.

        Raises:
            CommandError: The message does not have one value for each joint.
        """
        found = read_joints(message, part, self._names)
        if isinstance(found, Refusal):
            raise CommandError(f"it {found.value}; needed: {part} of {', '.join(self._names)}")
        return found

    def _move_cp(self, message: Any) -> Told:
        found = self._motion.solve(_transform(message))
        return found if isinstance(found, tuple) else self._locked(self._motion.move, found)

    def _interpolate_cp(self, message: Any) -> Told:
        found = self._motion.solve(_transform(message))
        if isinstance(found, tuple):
            return found
        return self._locked(self._motion.servo, found, self._node.platform.time_ns(), Leader.INTERPOLATE_CP)


class CommandError(TeleopError):
    """A message is not a valid command for this arm."""


def _transform(message: Any) -> Array:
    p, q = message.pose.position, message.pose.orientation
    pose = np.array([p.x, p.y, p.z, q.w, q.x, q.y, q.z])
    length = np.linalg.norm(pose[3:])
    if not abs(length - 1.0) <= _UNIT:  # NaN is not 1 either
        raise CommandError(f"its quaternion has length {length:.4g}, must be 1")
    pose[3:] /= length
    T = np.empty((4, 4))
    transform_from_pose(pose, T)
    return T


_UNIT = 1e-3


def _twist(message: Any) -> list[float]:
    v, w = message.twist.linear, message.twist.angular
    return [v.x, v.y, v.z, w.x, w.y, w.z]


class MeasuredTopics:
    """Measurements in addition to the streams, sent a hundred times a second while there is a reader.

    Args:
        node: Node that owns the topics.
        stage: The slave.
    """

    def __init__(self, node: Any, stage: Any) -> None:
        self._node, self._stage = node, stage
        names = stage.robot.joint_names
        self._publishers = {
            topic: node.ros.create_lifecycle_publisher(message_type(topic.kind.ros_type), topic.name, profile(topic))
            for topic in (MEASURED_CV, GOAL_JS, GOAL_CP, BODY_CF, SPATIAL_CF)
        }
        self._layouts = {t: layout(t.of_arm(node.arm), names) for t in self._publishers}
        self._jacobian = node.ros.create_lifecycle_publisher(message_type(_MATRIX), JACOBIAN, profile(MEASURED_CV))
        self._force: Any = None  # newest message of the force sensor
        self._forces: Any = None  # subscription, while there is a reader of forces in other frames
        self._timer = node.ros.create_timer(_PERIOD, self._send)
        self._timer.cancel()
        self._look = node.ros.create_timer(_LOOK, self._look_for_readers)

    def close(self) -> None:
        """Close the topics."""
        for timer in (self._timer, self._look):
            self._node.ros.destroy(timer)
        for publisher in (*self._publishers.values(), self._jacobian):
            self._node.ros.destroy(publisher)
        self._listen(is_read=False)

    def _look_for_readers(self) -> None:
        is_read = any(p.get_subscription_count() for p in (*self._publishers.values(), self._jacobian))
        if is_read and self._timer.is_canceled() and self._node.is_at_work:
            self._timer.reset()
        elif not is_read:
            self._timer.cancel()
        readers = [self._publishers[t].get_subscription_count() for t in (BODY_CF, SPATIAL_CF)]
        self._listen(is_read=any(readers))

    def _listen(self, *, is_read: bool) -> None:
        """Begin or end the subscription of the force sensor."""
        if is_read and self._forces is None:
            kind = message_type(SLAVE_MEASURED_CF.kind.ros_type)
            self._forces = self._node.ros.create_subscription(kind, SLAVE_MEASURED_CF.name, self._take, STREAMED)
        elif not is_read and self._forces is not None:
            self._node.ros.destroy(self._forces)
            self._forces = self._force = None

    def _take(self, message: Any) -> None:
        self._force = message

    def _send(self) -> None:
        if not self._node.is_at_work:
            return
        robot, n = self._stage.robot, self._stage.robot.n
        with self._node.lock:
            row = self._stage.signals
            now_ns, measured = int(row["now_ns"]), row["slave_measured_js"].copy()
            tip = row["slave_measured_cp"].copy()
            goal = self._stage.motion.goal
        J = np.empty((6, n))
        robot.kernels.jacobian(measured[:n].copy(), robot.geometry_row, J)
        T, pose = np.empty((4, 4)), np.empty(7)
        robot.kernels.fk(goal, robot.geometry_row, T)
        pose_from_transform(T, pose)
        values = {MEASURED_CV: J @ measured[n : 2 * n], GOAL_JS: goal, GOAL_CP: pose}
        for topic, value in values.items():
            self._publish(topic, now_ns, value)
        self._jacobian.publish(_matrix(J))
        if self._force is not None:
            self._send_force(tip)

    def _send_force(self, pose: Array) -> None:
        """Publish the newest force once, with its stamp, in body and spatial frame of a tip at ``pose`` (7,)."""
        message, self._force = self._force, None
        found = read_values(SLAVE_MEASURED_CF.kind, message)
        if isinstance(found, Refusal):
            return
        stamp_ns, wrench = found
        framed = framed_wrenches(wrench, pose)
        for topic, value in zip((BODY_CF, SPATIAL_CF), framed, strict=True):
            self._publish(topic, stamp_ns, value)

    def _publish(self, topic: Topic, stamp_ns: int, values: Array) -> None:
        self._publishers[topic].publish(self._layouts[topic].encode_one(stamp_ns, values))


def _matrix(rows: Array) -> Any:
    """Message that contains a matrix, row by row."""
    dimension = message_type("std_msgs/msg/MultiArrayDimension")
    message = message_type(_MATRIX)(data=rows.ravel().tolist())
    height, width = rows.shape
    message.layout.dim = [
        dimension(label="rows", size=height, stride=height * width),
        dimension(label="columns", size=width, stride=width),
    ]
    return message
