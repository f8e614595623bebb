"""Errors: every wrong use of the package raises a subclass of :class:`TeleopError`.

Expected events (a joint limit, a stale command, an unreachable pose) are never errors; they are returned as a status
beside the value.
"""

from collections.abc import Iterable
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from teleop_core.base.texts import LONGEST_LINE, one_line, printable, shown

_SHOWN = 40
"""Largest number of alternatives that a message lists completely."""
_NEAR = 8  # largest number of similar names that a message lists


class TeleopError(Exception):
    """Base of all errors of this package; its text is one line that a user can act on.

    Parts of the text may come from files and topics, so the text is made printable, and long texts are cut.
    """

    def __init__(self, text: str = "") -> None:
        super().__init__(one_line(text))

    def __reduce__(self) -> tuple[Any, ...]:
        """Data from which pickle makes the same error in another process."""
        return _same, (type(self), str(self), self.__dict__)


class TeleopWarning(UserWarning):
    """Category of all warnings of this package: the program runs, but possibly not as intended."""


def _same(kind: type[TeleopError], text: str, attributes: dict[str, object]) -> TeleopError:
    error = kind.__new__(kind, text)
    error.__dict__.update(attributes)
    return error


class ParameterError(TeleopError, ValueError):
    """A value is not allowed: carries ``name``, ``value`` and ``requirement``."""

    def __init__(self, name: str, value: object, requirement: str) -> None:
        self.name, self.value, self.requirement = name, value, requirement
        super().__init__(f"{name} is {shown(value)}, must be {requirement}")


class UnknownNameError(ParameterError):
    """A name is not in its list: carries the ``alternatives``, each once.

    The text lists the most similar alternatives first; if there are many, it lists only the similar ones.
    """

    def __init__(self, kind: str, value: object, alternatives: Iterable[str]) -> None:
        self.alternatives = named = tuple(dict.fromkeys(alternatives))
        name = shown(value).strip("'")
        near = get_close_matches(name, named, n=_NEAR)
        named = tuple(dict.fromkeys((*near, *named)))
        if len(named) > _SHOWN or sum(map(len, named)) > LONGEST_LINE // 2:
            near = get_close_matches(name, named, n=_NEAR, cutoff=0.3)
            named = (*(near or named[:_NEAR]), f"… ({len(self.alternatives)} in all)")
        super().__init__(kind, value, "one of: " + ", ".join(named))


class ClosureError(ParameterError):
    """The loops of a robot do not close with the given joints: carries the remaining ``residual`` [m]."""

    def __init__(self, name: str, value: object, requirement: str, residual: float) -> None:
        self.residual = residual
        super().__init__(name, value, requirement)


class PartError(TeleopError):
    """A part cannot be used: carries its ``kind``, its ``name`` and what was ``expected``."""

    def __init__(self, kind: str, name: str, expected: str) -> None:
        self.kind, self.name, self.expected = kind, name, expected
        super().__init__(f"{kind} {name!r} must be {expected}")


class KernelError(TeleopError):
    """A kernel cannot be compiled: carries its ``place``, file:line, and the ``reason``."""

    def __init__(self, place: str, reason: str) -> None:
        self.place, self.reason = place, reason
        super().__init__(f"{place}: {reason}")


class ShapeError(TeleopError, ValueError):
    """An array has the wrong shape: carries ``name``, ``expected`` and ``received``."""

    def __init__(self, name: str, expected: object, received: object) -> None:
        self.name, self.expected, self.received = name, expected, received
        super().__init__(f"{name} must have shape {expected}, has {received}")


class MessageTypeError(TeleopError, ImportError):
    """The package of a message is not installed: carries ``ros_type`` and ``package``."""

    def __init__(self, ros_type: str, package: str) -> None:
        self.ros_type, self.package = ros_type, package
        build = "run `make crtk_msgs`, or " if package == "crtk_msgs" else ""
        super().__init__(
            f"{ros_type} needs the package {package}, which is not installed: {build}source a workspace that has it"
        )


class RecordingError(TeleopError):
    """A recording cannot be written or read: carries its ``path`` and the ``reason``."""

    def __init__(self, path: Path | str, reason: str) -> None:
        self.path, self.reason = Path(path), reason
        super().__init__(f"{path}: {reason}")


class EvaluationError(TeleopError):
    """A recording lacks what a score needs; the text states what is missing."""


class SessionError(TeleopError):
    """A live session failed; the text names the node and the reason, followed by the node's last lines of output."""

    def __init__(self, text: str) -> None:
        Exception.__init__(self, printable(text))
