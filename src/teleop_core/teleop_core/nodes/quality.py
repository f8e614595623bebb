"""Quality: QoS of topics, by default and with ``qos_overrides`` parameters.

The overrides have the form that ROS defines: ``qos_overrides./slave/measured_js.publisher.reliability: best_effort``
in a parameter file or after ``--ros-args -p`` changes one policy of a node's publisher or subscription of a topic. The
topic has its full name.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Literal

from teleop_core.base.errors import ParameterError
from teleop_core.graph.topics import Quality, Topic
from teleop_core.middleware.platform import Qos

PREFIX = "qos_overrides."
Side = Literal["publisher", "subscription"]
_SIDES: tuple[Side, ...] = ("publisher", "subscription")
_DEPTHS = {Quality.STREAM: 1, Quality.LATCHED: 1, Quality.REPORT: 10}
_CHOICES: dict[str, tuple[str, dict[str, bool]]] = {
    "reliability": ("is_reliable", {"reliable": True, "best_effort": False}),
    "durability": ("is_latched", {"volatile": False, "transient_local": True}),
    "history": ("keeps_all", {"keep_last": False, "keep_all": True}),
}
_DEPTH_MAX = 100_000


def profile(topic: Topic, depth: int | None = None, side: Side = "publisher") -> Qos:
    """QoS of a topic, before overrides.

    A stream is offered as reliable, so that reliable and best-effort subscribers get it. Readers of this package
    subscribe with best effort: they need only the newest sample and receive senders of both kinds.

    Args:
        topic: The topic.
        depth: Queue length instead of the topic's own, for long queues.
        side: Publisher or subscription.
    """
    is_best_effort = topic.quality is Quality.STREAM and side == "subscription"
    return Qos(
        depth=depth or _DEPTHS[topic.quality],
        is_reliable=not is_best_effort,
        is_latched=topic.quality is Quality.LATCHED,
    )


class QualityOverrides:
    """The ``qos_overrides`` of one node.

    Args:
        given: All parameters that the node was given.

    Raises:
        ParameterError: An override has an invalid form or value.
    """

    def __init__(self, given: Mapping[str, object]) -> None:
        self._values = {name: _checked(name, value) for name, value in given.items() if name.startswith(PREFIX)}
        self._used: set[str] = set()

    def apply(self, name: str, side: Side, base: Qos) -> Qos:
        """QoS of a publisher or subscription after overrides; ``name`` is the full name of its topic."""
        for key, (policy, value) in self._values.items():
            if key.startswith(f"{PREFIX}{name}.{side}."):
                base = replace(base, **{policy: value})
                self._used.add(key)
        return base

    def unused(self) -> list[str]:
        """Overrides of topics that were not opened, sorted."""
        return sorted(set(self._values) - self._used)

    def concerns(self) -> list[str]:
        """Texts about overrides that have no effect."""
        unused = self.unused()
        return [f"no effect of {', '.join(unused)}: no such topic is open here"] if unused else []


NO_OVERRIDES = QualityOverrides({})
"""Overrides of a node without given overrides."""


def _checked(name: str, value: object) -> tuple[str, Any]:
    """Attribute of :class:`Qos` and value of one override."""
    topic, _, policy = name.removeprefix(PREFIX).rpartition(".")
    topic, _, side = topic.rpartition(".")
    if not topic.startswith("/") or side not in _SIDES:
        form = f"{PREFIX}/TOPIC.{'|'.join(_SIDES)}.{'|'.join((*_CHOICES, 'depth'))}"
        raise ParameterError(name, value, f"named {form}, with the topic's full name")
    if policy == "depth":
        return policy, _depth(name, value)
    if policy not in _CHOICES:
        raise ParameterError(name, value, f"one of {', '.join((*_CHOICES, 'depth'))}, by its name")
    attribute, choices = _CHOICES[policy]
    if not isinstance(value, str) or value not in choices:
        raise ParameterError(name, value, f"one of {', '.join(choices)}")
    return attribute, choices[value]


def _depth(name: str, value: object) -> int:
    if not isinstance(value, int) or isinstance(value, bool) or not 1 <= value <= _DEPTH_MAX:
        raise ParameterError(name, value, f"a whole number from 1 to {_DEPTH_MAX}")
    return value
