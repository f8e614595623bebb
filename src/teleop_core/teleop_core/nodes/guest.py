"""Guest: a node that observes or commands the nodes of a session, but does not belong to it."""

from typing import Any, Self

from teleop_core.middleware.platform import Platform
from teleop_core.middleware.ros import ROS
from teleop_core.middleware.ros_type_support import spare_generator

spare_generator()  # must be called before the first node is made


class Guest:
    """Owner of a node with its own middleware context; a context manager for ``with``.

    Args:
        name: Name of the node.
        domain: ROS domain; None for the domain of the environment.
        platform: Platform of the session.
        options: Further options of the node, as in rclpy.

    Attributes:
        platform: Platform of the guest.
        ros: The node.
    """

    def __init__(self, name: str, domain: int | None = None, platform: Platform = ROS, **options: Any) -> None:
        self.platform = platform.guest(domain)
        self.ros = self.platform.node(name, use_global_arguments=False, enable_rosout=False, **options)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Destroy the node."""
        self.ros.destroy_node()
        self.platform.shutdown()
