"""Making: makes the node of a stage, from the stage's own node class or from a generic class."""

from importlib import import_module
from typing import Any

from teleop_core.graph.stage import Stage
from teleop_core.nodes.base import CoreNode


def node_class(stage: Stage) -> Any:
    """Node class of a stage.

    Stages without their own class get a generic one, chosen by whether they have a trigger.
    """
    kind = "answering:AnsweringNode" if stage.trigger is not None else "ticking:TickingNode"
    module, _, name = (stage.node or f"teleop_core.nodes.{kind}").partition(":")
    return getattr(import_module(module), name)


def make_node(stage: Stage, **options: Any) -> CoreNode:
    """Node of a stage; ``options`` are those of :class:`~teleop_core.nodes.tuned.TunedNode`."""
    node: CoreNode = node_class(stage)(stage, **options)
    return node
