"""Guest: a node that looks at the nodes of a session, or commands them, and is none of them."""

from typing import Any, Self

from teleop_core.middleware.ros import ROS
from teleop_core.middleware.ros_type_support import spare_generator
from teleop_core.middleware.world import World

spare_generator()  # before the first node


class Guest:
    """Owner of a node with a middleware context of its own, to be used with ``with``.

    Args:
        name: What the node is called.
        domain: ROS domain; None for that of the environment.
        world: Where it is.
        options: Further ones of the node, as rclpy has them.

    Attributes:
        world: Where it is, as a guest.
        ros: The node.
    """

    def __init__(self, name: str, domain: int | None = None, world: World = ROS, **options: Any) -> None:
        self.world = world.guest(domain)
        self.ros = self.world.node(name, use_global_arguments=False, enable_rosout=False, **options)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Leave."""
        self.ros.destroy_node()
        self.world.shutdown()
