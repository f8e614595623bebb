"""Display: a stage that shows the slave to the operator like a screen, frame by frame, late, and not every frame."""

from dataclasses import dataclass
from typing import Annotated

from teleop_core.base import ParameterError, Within, fixed, parameter
from teleop_core.graph import Row, Stage, topics
from teleop_core.kernels import Array, Fields, Integers, inner, kernel

_FRAMES = 512
"""Largest number of frames on the way to the screen."""
_WORD = 0xFFFFFFFF
_LOSS, _JITTER = range(2)
SHOWS = ("slave", "command")
"""Choices for what a frame shows: the slave's measured pose, or its commanded pose."""
_COMMAND = SHOWS.index("command")


@dataclass(frozen=True, kw_only=True)
class DisplayParameters:
    """Frames in which the operator sees the slave: how many, how late, and how regular."""

    rate: float = parameter(
        60.0,
        Within(1.0, 240.0, "Hz"),
        "frame rate of the display",
        source="published: UVA-DSA telesurgery QoS analysis 2026 draws at 60 Hz",
    )
    latency: float = parameter(
        0.033,
        Within(0.0, 2.0, "s"),
        "time from taking a frame to showing it on the screen; delays of a network add to it",
        source="assumed: two frames at 60 Hz",
    )
    loss: float = parameter(0.0, Within(0.0, 1.0), "share of frames that never come; with 1 the picture freezes")
    jitter: float = parameter(
        0.0,
        Within(0.0, 2.0, "s"),
        "largest additional latency of a frame, drawn for each frame from 0 to this; a frame waits for those before it",
    )
    shows: str = parameter(
        "slave",
        choices=SHOWS,
        doc="slave: the display shows the slave's measured pose; command: it shows the commanded "
        "pose, which no network delays (a predictive display)",
    )

    seed: int = fixed(1, Within(0), "seed of everything random in the session")

    def __post_init__(self) -> None:
        if self.rate * (self.latency + self.jitter) > _FRAMES - 2:
            needed = f"{_FRAMES - 2} frames at most on the way ({self.rate:g} Hz x (latency + jitter))"
            name = "latency" if self.latency >= self.jitter else "jitter"
            raise ParameterError(f"display.{name}", getattr(self, name), needed)


class DisplayState(Fields):
    """Frames that are taken but not yet shown."""

    drawn: int  # number of frames so far, with those that never come
    taken: int  # number of frames taken so far, without them
    shown: int
    due_ns: int  # time at which the next frame is taken
    frames: Annotated[Array, 7 * _FRAMES]
    stamps: Annotated[Integers, _FRAMES]
    times: Annotated[Integers, _FRAMES]  # time from which the latency of each frame counts [ns]


@inner
def _mixed(word: int) -> int:
    """Another word of 32 bits: a bijection whose bits look random (``lowbias32`` of Wellons 2018)."""
    word = int(word)  # without a compiler a NumPy integer would tell of its overflow
    word = ((word ^ (word >> 16)) * 0x7FEB352D) & _WORD
    word = ((word ^ (word >> 15)) * 0x846CA68B) & _WORD
    return word ^ (word >> 16)


@inner
def _chance(seed: int, frame: int, which: int) -> float:
    """Random number in [0, 1) for a frame; it depends on nothing else, so it is the same in live sessions."""
    return _mixed(_mixed(_mixed(seed & _WORD) ^ (frame & _WORD)) ^ which) / (_WORD + 1.0)


@kernel
def display_step(p: DisplayParameters, s: DisplayState, row: Row, dt: float) -> None:
    """One tick: take a frame if one is due, and show the newest frame whose latency is over.

    A frame is not shown before those that were taken before it, as in a film whose pictures build on each other.

    Args:
        p: Parameter record.
        s: State record; written.
        row: Signals; ``display_measured_cp`` is written, with the stamp of the pose that it shows.
        dt: Tick [s].
    """
    is_command = int(p.shows) == _COMMAND  # a choice among texts is stored as its index
    stamp_ns = row.slave_servo_cp_ns if is_command else row.slave_measured_cp_ns
    if row.now_ns >= s.due_ns and stamp_ns > 0:  # without a stamp there is no pose to show yet
        s.due_ns = max(s.due_ns, row.now_ns - 1_000_000_000) + int(1e9 / p.rate)
        s.drawn += 1
        if p.loss == 0.0 or _chance(p.seed, s.drawn, _LOSS) >= p.loss:
            at = s.taken % _FRAMES
            shown = row.slave_servo_cp if is_command else row.slave_measured_cp
            for i in range(7):
                s.frames[7 * at + i] = shown[i]
            s.stamps[at] = stamp_ns
            s.times[at] = row.now_ns
            if p.jitter > 0.0:
                s.times[at] += int(1e9 * p.jitter * _chance(p.seed, s.drawn, _JITTER))
            s.taken += 1
    latest_ns = row.now_ns - int(1e9 * p.latency + 0.5)
    while s.shown < s.taken and s.times[s.shown % _FRAMES] <= latest_ns:
        at = s.shown % _FRAMES
        for i in range(7):
            row.display_measured_cp[i] = s.frames[7 * at + i]
        row.display_measured_cp_ns = s.stamps[at]
        s.shown += 1


DISPLAY = Stage(
    "display",
    DisplayParameters,
    reads=(topics.SLAVE_MEASURED_CP, topics.SLAVE_SERVO_CP),
    writes=(topics.DISPLAY_MEASURED_CP,),
    step=display_step,
    state=DisplayState,
    replaces=topics.SLAVE_MEASURED_CP,
    serves=("operator",),
)
