"""Names: our joints and those of an arm, in order, sign and offset."""

from collections.abc import Sequence

import numpy as np

from teleop_core.base.errors import ParameterError
from teleop_core.kernels.geometry import Array


class JointMap:
    """Which of the arm's joints is which of ours: ours = sign · the arm's + offset.

    Args:
        ours: Names of the robot's joints.
        renamed: ``ours=theirs`` for each joint that the arm calls otherwise.
        signs: 1 or -1 for each of our joints; empty: 1.
        offsets: Of each of our joints [rad or m]; empty: 0.
        order: The arm's joints in the order of its commands; empty: in that of ours.
        owner: What the names of the parameters begin with, for messages.
        is_scaled: Whether signs may be other numbers too, as where the other one counts a way.

    Attributes:
        theirs: The arm's names, in our order.
        order: The arm's names, in the order of its commands.

    Raises:
        ParameterError: One has another form, or names what there is not.
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
        """Where each of our joints stands in a message with these names, or what is wrong.

        Further joints, as of a gripper, do no harm.
        """
        names = tuple(names)
        if names != self._known[0]:
            missing = [name for name in self.theirs if name not in names]
            twice = [name for name in self.theirs if names.count(name) > 1]
            if missing:
                heard = ", ".join(names) or "no names"
                return f"it says nothing of {', '.join(missing)}; it names {heard}"
            if twice:
                return f"it names {', '.join(twice)} twice"
            self._known = names, [names.index(name) for name in self.theirs]
        return self._known[1]

    def is_strange(self, names: Sequence[str]) -> bool:
        """Whether a message names only other joints, as that of a gripper on the same topic."""
        return not set(self.theirs) & set(names)

    def position(self, theirs: Array) -> Array:
        """Our joints (n,) of the arm's positions in our order [rad or m]."""
        return self._signs * theirs + self._offsets

    def rate(self, theirs: Array) -> Array:
        """Our velocities (n,) of the arm's in our order."""
        return self._signs * theirs

    def effort(self, theirs: Array) -> Array:
        """Our efforts (n,) of the arm's in our order, which do the same work."""
        return theirs / self._signs

    def command(self, ours: Array) -> Array:
        """The arm's positions (n,), in the order of its commands, of ours [rad or m]."""
        return ((ours - self._offsets) / self._signs)[self._sent]

    def command_rate(self, ours: Array) -> Array:
        """The arm's velocities (n,), in the order of its commands, of ours [rad/s or m/s]."""
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
        raise ParameterError(parameter, tuple(renamed), "another joint for each of ours")
    return theirs
