"""Guest: a node that looks at the nodes of a session, or commands them, and is none of them."""

from typing import Any, Self

from rclpy.context import Context
from rclpy.node import Node

from teleop_core.nodes.type_support import spare_generator

spare_generator()  # before the first node


class Guest:
    """Owner of a node with a middleware context of its own, to be used with ``with``.

    Args:
        name: What the node is called.
        domain: ROS domain; None for that of the environment.
        options: Further ones of the node, as rclpy has them.

    Attributes:
        node: The node.
    """

    def __init__(self, name: str, domain: int | None = None, **options: Any) -> None:
        self._context = Context()
        self._context.init(args=[], domain_id=domain)
        self.node = Node(
            name, context=self._context, use_global_arguments=False, enable_rosout=False, **options
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Leave."""
        self.node.destroy_node()
        self._context.try_shutdown()
