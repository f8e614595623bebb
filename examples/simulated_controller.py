"""Drill a bridge before there is an arm: a model of its controller, on a simulated machine.

The model has a delay, its own order of joints, and a fault. Replace ``bridge`` by your own bridge.
"""

import tempfile
from dataclasses import dataclass
from pathlib import Path

from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from teleop_core.middleware.platform import Qos
from teleop_core.robots import load_robot
from teleop_drill import chosen
from teleop_drill.simulation.drill import simulated_drill
from teleop_drill.simulation.platform import SimulatedPlatform
from teleop_drill.simulation.stand_ins import run_node

ROBOT = load_robot("rcrt1")
COMMANDS = "/forward_position_controller/commands"
ORDER = ROBOT.joint_names[::-1]  # joint order of the controller, which counts from the tool
PERIOD, RATE = 0.002, 150.0  # s; 1/s


@dataclass
class Controller:
    """Model of a controller that receives arrays of positions, and publishes its joint positions.

    Attributes:
        delay_ns: Delay from a command to its effect [ns].
        coasts: Time for which the arm continues at its last speed when commands end [s].
        order: Order of the joints in its commands.
    """

    delay_ns: int = 5_000_000
    coasts: float = 0.0
    order: tuple[str, ...] = ORDER

    def run(self, platform: SimulatedPlatform) -> int:
        """Run the process of the controller."""
        self.platform, node, executor = platform, platform.node("controller"), platform.executor()
        self.place = dict(zip(ROBOT.joint_names, ROBOT.home.tolist(), strict=True))
        self.coming, self.taken_ns = [(0, self.place)], 0
        executor.add_node(node)
        self.says = node.create_publisher(JointState, "/joint_states", Qos())
        node.create_subscription(Float64MultiArray, COMMANDS, self.take, Qos())
        node.create_timer(PERIOD, self.cycle)
        while True:
            executor.spin_once()

    def take(self, message: Float64MultiArray) -> None:
        """Store a command, which takes effect later."""
        self.taken_ns = self.platform.time_ns()
        goal = dict(zip(self.order, message.data, strict=True))
        self.coming.append((self.taken_ns + self.delay_ns, goal))

    def cycle(self) -> None:
        """Advance by one period, and publish the joint positions."""
        now_ns = self.platform.time_ns()
        while len(self.coming) > 1 and self.coming[1][0] <= now_ns:
            self.coming.pop(0)
        if 4e6 < now_ns - self.taken_ns < 1e9 * self.coasts:
            self.coming = [(0, self.place)]
        else:
            self.speed = {n: RATE * (q - self.place[n]) for n, q in self.coming[0][1].items()}
        self.place = {n: q + self.speed[n] * PERIOD for n, q in self.place.items()}
        said = JointState(name=list(self.place), position=list(self.place.values()))
        said.velocity = [self.speed[name] for name in said.name]
        said.header.stamp.sec, said.header.stamp.nanosec = divmod(now_ns, 1_000_000_000)
        self.says.publish(said)


def bridge(platform: SimulatedPlatform) -> int:
    """Run the process of the bridge."""
    return run_node(platform, "arm_bridge", kind="forward_command", order=ORDER)


def main() -> None:
    """Drill the bridge with a correct controller, and with a controller that coasts."""
    rows = chosen(("stop_topic", "freeze_slave_sim"), is_composed=False)
    for name, model in {"sound": Controller(), "coasts": Controller(coasts=0.4)}.items():
        print(f"{name}:")
        with tempfile.TemporaryDirectory() as folder:
            simulated_drill(rows, Path(folder), print, drives=bridge, arm=model.run)


if __name__ == "__main__":
    main()
