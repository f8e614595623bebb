"""Task end: detects that no task of a session has a goal left, so that the session may end."""

import numpy as np

from teleop_core.graph.graph import Graph
from teleop_core.graph.topics import TASK_STATE
from teleop_core.middleware.platform import Owner
from teleop_core.nodes.streams import Input

_OVER = TASK_STATE.columns.index("is_over")


class TaskEnd:
    """Reads ``task/state`` of each arm that has a task.

    Args:
        owner: Node that owns the subscriptions and closes them.
        graph: Graph of the session.
    """

    def __init__(self, owner: Owner, graph: Graph) -> None:
        tasks = [topic for topic in graph.streams if topic == TASK_STATE.of_arm(topic.arm)]
        self._told = np.zeros((len(tasks), len(TASK_STATE.columns)))
        self._inputs = [
            Input(owner, topic, f"/{topic.name}", (), told) for topic, told in zip(tasks, self._told, strict=True)
        ]

    def is_there(self) -> bool:
        """Whether there are tasks, and none of them has a goal left according to its last message."""
        for heard in self._inputs:
            heard.newest()
        return len(self._told) > 0 and bool((self._told[:, _OVER] > 0.0).all())
