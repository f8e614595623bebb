"""Controllers of real arms as processes of a simulated machine."""

from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from plain_controller import RATE, Controller
from teleop_core.middleware.platform import Qos
from teleop_drill.simulation.platform import SimulatedPlatform
from teleop_drill.simulation.stand_ins import Work


def controller(kind: str, arm: str = "rcrt1", seed: str = "") -> Work:
    """The plain controller of an arm, as a process."""

    def work(platform: SimulatedPlatform) -> int:
        node, executor = platform.node("plain_controller"), platform.executor()
        made = Controller(kind, arm, seed, now=lambda: 1e-9 * platform.monotonic_ns(), time_ns=platform.time_ns)
        for topic, message, take in made.topics:
            node.create_subscription(message, f"/{topic.strip('/')}", take, Qos(depth=1000))
        says = node.create_publisher(JointState, made.says, Qos())
        witness = node.create_publisher(Float64MultiArray, "/witness", Qos())

        def cycle() -> None:
            for publisher, message in zip((says, witness), made.cycle(), strict=True):
                if message is not None:
                    publisher.publish(message)

        node.create_timer(1.0 / RATE, cycle)
        executor.add_node(node)
        while True:
            executor.spin_once()

    return work
