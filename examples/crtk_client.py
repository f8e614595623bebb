"""A CRTK client that uses only rclpy: waits for an arm, moves its tip by 10 mm, and moves it back.

Start an arm first, ``teleop live --composed --out bags/crtk`` or ``ros2 run teleop_core slave``
on the same ROS domain, and build CRTK's messages if ROS does not contain them: ``make crtk_msgs``.
"""

import sys
import time
from collections.abc import Callable

try:
    import rclpy
    from crtk_msgs.msg import OperatingState
    from geometry_msgs.msg import PoseStamped
    from rclpy.node import Node
except ModuleNotFoundError as error:
    what = "make crtk_msgs" if error.name == "crtk_msgs" else "pip install 'teleop_core[ros]'"
    sys.exit(f"needs {error.name}, which is not installed: {what}")

AXES = "xyz"
WAY = 0.01  # [m]


class Client(Node):
    """The data of an ordinary client: the newest state and setpoint, and a move whose end it awaits."""

    def __init__(self, arm: str) -> None:
        super().__init__("crtk_client")
        self.state: OperatingState | None = None
        self.setpoint: PoseStamped | None = None
        self.was_busy = False
        self.create_subscription(OperatingState, f"{arm}/operating_state", self.take_state, 10)
        self.create_subscription(PoseStamped, f"{arm}/setpoint_cp", self.take_setpoint, 1)
        self.move_cp = self.create_publisher(PoseStamped, f"{arm}/move_cp", 10)

    def take_state(self, state: OperatingState) -> None:
        """Store the newest state, and whether any state was busy."""
        self.state = state
        self.was_busy = self.was_busy or state.is_busy

    def take_setpoint(self, setpoint: PoseStamped) -> None:
        """Store the newest setpoint."""
        self.setpoint = setpoint

    def wait(self, condition: Callable[[], bool], what: str, seconds: float = 20.0) -> None:
        """Spin until a condition is true."""
        end = time.monotonic() + seconds
        while not condition():
            if time.monotonic() > end:
                sys.exit(f"not within {seconds:g} s: {what}")
            rclpy.spin_once(self, timeout_sec=0.1)

    def is_ready(self) -> bool:
        """Whether the arm accepts a move now."""
        state = self.state
        if state is None or self.setpoint is None:
            return False
        return bool(state.state == "ENABLED" and state.is_homed and not state.is_busy)

    def move(self, goal: PoseStamped) -> bool:
        """Move to the goal; return whether the arm started to move."""
        self.was_busy = False
        goal.header.stamp = self.get_clock().now().to_msg()
        self.move_cp.publish(goal)
        end = time.monotonic() + 1.0
        while not self.was_busy and time.monotonic() < end:
            rclpy.spin_once(self, timeout_sec=0.1)
        if self.was_busy:
            self.wait(self.is_ready, "the end of the move")
        return self.was_busy


def main() -> None:
    """Move along each axis, then back."""
    rclpy.init()
    client = Client(sys.argv[1] if len(sys.argv) > 1 else "slave")
    client.wait(client.is_ready, "an arm that is enabled and homed")
    client.wait(lambda: client.move_cp.get_subscription_count() > 0, "a reader of move_cp")
    home = client.setpoint
    assert home is not None
    for axis in AXES:
        goal = PoseStamped()
        goal.pose.orientation = home.pose.orientation
        for name in AXES:
            setattr(goal.pose.position, name, getattr(home.pose.position, name))
        setattr(goal.pose.position, axis, getattr(home.pose.position, axis) - WAY)
        print(f"-{1e3 * WAY:g} mm along {axis}:", "done" if client.move(goal) else "out of reach")
    client.move(home)
    print("back")
    rclpy.shutdown()


if __name__ == "__main__":
    main()
