"""Names: map between our joints and those of an arm, with order, sign and offset."""

from collections.abc import Sequence

import numpy as np

from teleop_core.base.errors import ParameterError
from teleop_core.kernels.geometry import Array


class JointMap:
    """Map between the arm's joints and ours: our position = sign · the arm's position + offset.

    Args:
        ours: Names of the robot's joints.
        renamed: ``ours=theirs`` for each joint that has another name in the arm.
        signs: 1 or -1 for each of our joints; if empty, all are 1.
        offsets: Offset of each of our joints [rad or m]; if empty, all are 0.
        order: The arm's joints in the order of its commands; if empty, in the order of our joints.
        owner: Prefix of the parameter names, for messages.
        is_scaled: Whether signs may also be other numbers, such as for a gripper that counts a distance.

    Attributes:
        theirs: The arm's names, in our order.
        order: The arm's names, in the order of its commands.

    Raises:
        ParameterError: A parameter has the wrong form, or names a joint that does not exist.
    """

    def __init__(
        self,
        ours: Sequence[str],
        renamed: Sequence[str] = (),
        signs: Sequence[float] = (),
        offsets: Sequence[float] = (),
        order: Sequence[str] = (),
        owner: str = "arm_bridge.",
        *,
        is_scaled: bool = False,
    ) -> None:
        self.ours, self.theirs = tuple(ours), _theirs(ours, renamed, f"{owner}joints")
        n = len(self.ours)
        is_one = is_scaled or all(abs(sign) == 1.0 for sign in signs)
        if len(signs) not in {0, n} or not is_one:
            raise ParameterError(f"{owner}signs", tuple(signs), f"{n} of 1.0 or -1.0, or empty")
        if len(offsets) not in {0, n}:
            raise ParameterError(f"{owner}offsets", tuple(offsets), f"{n} numbers, or empty")
        if order and sorted(order) != sorted(self.theirs):
            needed = f"each of {', '.join(self.theirs)} once, or empty"
            raise ParameterError(f"{owner}order", tuple(order), needed)
        self._signs = np.array(signs, dtype=float) if signs else np.ones(n)
        self._offsets = np.array(offsets, dtype=float) if offsets else np.zeros(n)
        self.order = tuple(order) or self.theirs
        self._sent = np.array([self.theirs.index(name) for name in self.order])
        self._known: tuple[tuple[str, ...], list[int]] = ((), [])

    def places(self, names: Sequence[str]) -> list[int] | str:
        """Index of each of our joints in a message with these names, or a text that says what is wrong.

        Further joints in the message, such as a gripper's, are ignored.
        """
        names = tuple(names)
        if names != self._known[0]:
            missing = [name for name in self.theirs if name not in names]
            twice = [name for name in self.theirs if names.count(name) > 1]
            if missing:
                heard = ", ".join(names) or "no names"
                return f"it lacks {', '.join(missing)}; it names {heard}"
            if twice:
                return f"it names {', '.join(twice)} twice"
            self._known = names, [names.index(name) for name in self.theirs]
        return self._known[1]

    def is_strange(self, names: Sequence[str]) -> bool:
        """Whether a message names none of our joints, such as that of a gripper on the same topic."""
        return not set(self.theirs) & set(names)

    def position(self, theirs: Array) -> Array:
        """Our joint positions (n,) from the arm's positions in our order [rad or m]."""
        return self._signs * theirs + self._offsets

    def rate(self, theirs: Array) -> Array:
        """Our velocities (n,) from the arm's velocities in our order."""
        return self._signs * theirs

    def effort(self, theirs: Array) -> Array:
        """Our efforts (n,) from the arm's efforts in our order, so that the mechanical power is equal."""
        return theirs / self._signs

    def command(self, ours: Array) -> Array:
        """The arm's positions (n,), in the order of its commands, from our positions [rad or m]."""
        return ((ours - self._offsets) / self._signs)[self._sent]

    def command_rate(self, ours: Array) -> Array:
        """The arm's velocities (n,), in the order of its commands, from our velocities [rad/s or m/s]."""
        return (ours / self._signs)[self._sent]


def _theirs(ours: Sequence[str], renamed: Sequence[str], parameter: str) -> tuple[str, ...]:
    found = {name: name for name in ours}
    for text in renamed:
        own, equals, other = (part.strip() for part in text.partition("="))
        if not equals or own not in found or not other:
            needed = f"ours=theirs, with ours one of {', '.join(ours)}"
            raise ParameterError(parameter, text, needed)
        found[own] = other
    theirs = tuple(found.values())
    if len(set(theirs)) < len(theirs):
        raise ParameterError(parameter, tuple(renamed), "a different joint for each of our joints")
    return theirs
