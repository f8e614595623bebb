"""Filter: which messages of a page the console accepts; all others are dropped at the socket.

viser sets any attribute of any element that a page names, accepts positions of any shape, and stores uploads. So only
messages that are declared here reach viser. Their values must be within the declared bounds, and the page must be
allowed to send them. An accepted message is encoded anew from its checked values.
"""

import struct
import threading
import time
from collections import Counter
from collections.abc import Callable
from typing import Annotated, Any, Protocol

import msgspec
from msgspec import Meta, Struct

LARGEST = 256 * 1024
"""Largest message of a page [bytes]; it is the picture of an inset that a browser has drawn."""
RATE = 200.0
"""Largest number of frames per second that a page may send; a busy page sends 90."""
BURST = 400.0
"""Largest number of frames that a page may send in one burst."""
BYTES_RATE = 1e6
"""Largest number of bytes per second that a page may send; visible insets need 520,000."""
BYTES_BURST = 2e6
"""Largest number of bytes that a page may send in one burst."""
PICTURE = (180, 240)
"""Height and width of the picture that the console may request from a browser [px]."""

UNKNOWN = "not a message that this page sends"
WATCHES = "a page that watches cannot do this; take control first"
NOTHING_THERE = "for an element that does not exist, is inactive or hidden"
NO_VALUE = "a value that the element cannot have"
NO_TURN = "a quaternion that is not of unit length"
NOT_ASKED = "a picture that the console did not request"
FLOOD = f"more than {RATE:g} messages or {BYTES_RATE / 1e6:g} MB a second; it was cut off"

_Name = Annotated[str, Meta(max_length=200)]
_Unit = Annotated[float, Meta(ge=-1.01, le=1.01)]
_Place = Annotated[float, Meta(ge=-1.0, le=1.0)]  # coordinate of a stylus in master_base [m]
_Far = Annotated[float, Meta(ge=-1e4, le=1e4)]  # coordinate of a camera [m]
_Length = Annotated[float, Meta(gt=0.0, le=1e6)]
_Pixels = Annotated[int, Meta(ge=1, le=16384)]
_Quaternion = tuple[_Unit, _Unit, _Unit, _Unit]
_Number = Annotated[float, Meta(ge=-1e15, le=1e15)]
_Count = Annotated[int, Meta(ge=-(10**15), le=10**15)]
_OFF_UNIT = 1e-2  # tolerance of the squared length of a unit quaternion


class _Message(Struct, tag_field="type", forbid_unknown_fields=True):
    """A message of a page; floats are always finite, because they have bounds."""


class Looks(_Message, tag="ViewerCameraMessage"):
    """The page reports its camera."""

    wxyz: _Quaternion
    position: tuple[_Far, _Far, _Far]
    fov: Annotated[float, Meta(gt=0.0, lt=3.1416)]
    near: _Length
    far: _Length
    image_height: _Pixels
    image_width: _Pixels
    look_at: tuple[_Far, _Far, _Far]
    up_direction: tuple[_Far, _Far, _Far]


class Takes(_Message, tag="TransformControlsDragStartMessage"):
    """The page takes a gizmo."""

    name: _Name
    owner: _Name = ""


class Drags(_Message, tag="TransformControlsUpdateMessage"):
    """The page drags a gizmo to a pose in the frame of its parent."""

    name: _Name
    wxyz: _Quaternion
    position: tuple[_Place, _Place, _Place]
    owner: _Name = ""


class LetsGo(_Message, tag="TransformControlsDragEndMessage"):
    """The page releases a gizmo."""

    name: _Name
    owner: _Name = ""


class Value(Struct, forbid_unknown_fields=True):
    """The only attribute of an element that a page may set."""

    value: bool | _Count | _Number | Annotated[str, Meta(max_length=1000)]


class Sets(_Message, tag="GuiUpdateMessage"):
    """The page presses a button or changes a value."""

    uuid: _Name
    updates: Value


class Triggers(_Message, tag="CommandTriggerMessage"):
    """The page uses a keyboard shortcut of a command."""

    uuid: _Name


class Draws(_Message, tag="GetRenderResponseMessage"):
    """The page sends a requested picture."""

    payload: bytes
    render_uuid: _Name


_DECODER = msgspec.msgpack.Decoder(Looks | Takes | Drags | LetsGo | Sets | Triggers | Draws)
_ENCODER = msgspec.msgpack.Encoder()


def decode(data: bytes | str) -> _Message | None:
    """Decoded message of a page, within its bounds; None if the data is not such a message."""
    try:
        return _DECODER.decode(data)  # type: ignore[arg-type]
    except (TypeError, ValueError):  # a text; msgspec's errors are ValueErrors
        return None


class Elements(Protocol):
    """Access to the elements that the page shows now."""

    def control(self, page: int, uuid: str) -> Any | None:
        """Handle of an input that the page shows; None if there is none."""

    def has_command(self, uuid: str) -> bool:
        """Whether a command with this identifier exists."""

    def has_gizmo(self, name: str) -> bool:
        """Whether a gizmo with this name exists."""

    def is_public(self, uuid: str) -> bool:
        """Whether pages that do not drive may use an element."""

    def is_asked(self, page: int) -> bool:
        """Whether the console has requested a picture from a page."""


class Filter:
    """Checks the messages of all pages, and counts the refused messages.

    Args:
        elements: Elements of the page.
        may_drive: Whether a page may command the session.
        say: Called with a line at the first refusal of each kind.

    Attributes:
        refused: Number of refused messages, by reason.
    """

    def __init__(self, elements: Elements, may_drive: Callable[[int], bool], say: Callable[[str], None]) -> None:
        self._elements, self._may_drive, self._say = elements, may_drive, say
        self._lock = threading.Lock()
        self.refused: Counter[str] = Counter()

    def judge(self, page: int, data: bytes | str) -> tuple[bytes, str]:
        """Check a message; returns the encoded message for viser and an empty reason, or no message and the reason."""
        message = decode(data)
        reason = UNKNOWN if message is None else self._reason(page, message)
        if reason:
            self.refuse(page, reason)
            return b"", reason
        return _ENCODER.encode(message), ""

    def refuse(self, page: int, reason: str) -> None:
        """Count a refusal, and report the first of its kind."""
        with self._lock:
            self.refused[reason] += 1
            is_first = self.refused[reason] == 1
        if is_first:
            self._say(f"page {page + 1} was refused: {reason}")

    def _reason(self, page: int, message: _Message) -> str:
        """Reason why a message within its bounds is refused; empty if it is accepted."""
        elements = self._elements
        if isinstance(message, Looks | Drags) and not _is_unit(message.wxyz):
            return NO_TURN
        if isinstance(message, Looks):
            return ""
        if isinstance(message, Draws):
            is_answer = elements.is_asked(page) and is_picture(message.payload)
            return "" if is_answer else NOT_ASKED
        if isinstance(message, Sets):
            return self._why_not_set(page, message)
        if not self._may_drive(page):
            return WATCHES
        is_there = (
            elements.has_command(message.uuid) if isinstance(message, Triggers)
            else elements.has_gizmo(message.name)  # type: ignore[attr-defined]
        )  # fmt: skip
        return "" if is_there else NOTHING_THERE

    def _why_not_set(self, page: int, message: Sets) -> str:
        control = self._elements.control(page, message.uuid)
        if control is None or not control.visible or control.disabled:
            return NOTHING_THERE
        if not takes(control, message.updates.value):
            return NO_VALUE
        is_allowed = self._elements.is_public(message.uuid) or self._may_drive(page)
        return "" if is_allowed else WATCHES


def takes(control: Any, value: object) -> bool:
    """Whether a value suits an input of viser: type, options and bounds must match."""
    if hasattr(control, "options"):  # dropdowns and groups of buttons
        return value in control.options
    if isinstance(control.value, bool):  # buttons and boxes
        return isinstance(value, bool)
    if isinstance(control.value, str):
        return isinstance(value, str)
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    low, high = getattr(control, "min", None), getattr(control, "max", None)
    is_within = (low is None or value >= low) and (high is None or value <= high)
    return isinstance(control.value, int | float) and is_within


def is_picture(data: bytes) -> bool:
    """Whether data begin with the header of a PNG of the requested size, which limits the decompressed size."""
    return data[:8] == b"\x89PNG\r\n\x1a\n" and data[16:24] == struct.pack(">II", *PICTURE[::-1])


def _is_unit(wxyz: tuple[float, ...]) -> bool:
    return abs(sum(part * part for part in wxyz) - 1.0) < _OFF_UNIT


class Budget:
    """Number of frames and bytes that one page, or all pages together, may still send.

    Args:
        share: Budget as a multiple of the budget of one page.
        clock: Monotonic time [s].
    """

    def __init__(self, share: float = 1.0, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock, self._since, self._share = clock, clock(), share
        self._frames, self._bytes = share * BURST, share * BYTES_BURST

    def spend(self, frames: int, size: int) -> bool:
        """Subtract frames and bytes; returns whether the budget was large enough."""
        now = self._clock()
        passed, self._since = now - self._since, now
        most, more = self._share, self._share * passed
        self._frames = min(most * BURST, self._frames + more * RATE) - frames
        self._bytes = min(most * BYTES_BURST, self._bytes + more * BYTES_RATE) - size
        return self.left >= 0.0

    @property
    def left(self) -> float:
        """Smaller remaining share of frames and bytes: 1 if nothing is used, negative if the budget is exceeded."""
        return min(self._frames / BURST, self._bytes / BYTES_BURST) / self._share
