"""Verdict: one line about a score that names the worst problem first."""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import NamedTuple

from teleop_core.evaluation.plain import Leaf
from teleop_core.evaluation.published import BOX_OVERSHOOT_MM

SHARE = "reach.followed_share"
NAMED = 3
"""Largest number of concerns that a verdict names."""
# A value beyond its limit is a concern. The limits are assumed, except the overshoot of a fixture and ``_FOLLOWED``.
_FOLLOWED = 0.99  # share of followed time; below this limit, no published value is compared
_DRIFT_MM = 5.0  # lag behind the hand [mm]
_ERROR_MM = 1.0  # position error [mm]
_LATENCY_MS = 20.0  # delay from hand to setpoint [ms]
_SHARE = 1e-3  # share of missing messages or of dropped ticks
_CREATED_MJ = 1.0
"""Limit of the created energy [mJ]. It exceeds the energy that passivity lends, and the energy of a last touch before
the recording ends."""
_CAUSES = {
    "joint": "at a joint's end",
    "workspace": "beyond the workspace",
    "speed": "joints too slow",
    "singularity": "near a singularity",
    "aligning": "aligned anew",
}
_BUSY = "the machine was busy: close other programs, or give the session real-time priority"
_FIRST = 1e6  # weight of concerns that explain others
_ADVICE = {
    "gap.longest_s": (
        "nothing was recorded there, so what hand and arm did is unknown: the recorder or the machine stood still, or "
        "the file was cut; score the parts before and after the gap"
    ),
    "halt.share": "a fault or a stop kept the arm from following: its reason stands in slave/operation",
    SHARE: "the slave could not follow the hand: stay within its reach, or move the hand more slowly",
    "task.successes": (
        "the task's goals are out of reach, too small or too short in time for the operator: see `task.errors`"
    ),
    "asked_error_mm.max": "the tip lagged behind the hand: move the hand more slowly, or lower the gain",
    "position_error_mm.rms": "the drives lag behind the setpoint: move the hand more slowly, or change the gains",
    "topics": "stages or the recorder were too late to receive messages: the machine or the network was busy",
    "ticks.made_up": _BUSY,
    "ticks.dropped": _BUSY,
    "latency_ms.total.p99": "commands came late: the table of latencies names the stage",
    "passivity.slave.out_mj": "delayed forces added energy, which makes contacts bounce: choose reflection.passivity",
    "contact.feeding": "a wall pushed the hand harder on the way out than on the way in: lower the wall's "
    "stiffness or the delay, or choose reflection.passivity",
    "fixture.penetration_max_mm": "the hand pushed through the fixture: raise its stiffness, or push less",
}
Values = Mapping[str, Leaf]
"""Numbers of a score by their keys."""


class Concern(NamedTuple):
    """A problem: the ratio of the value to its acceptable limit, the value's key, and a text."""

    weight: float
    key: str
    text: str


@dataclass(frozen=True)
class Verdict:
    """Summary of a score.

    Attributes:
        text: One line that names the worst problem first.
        worst: Key of the worst value; None if all values are acceptable.
        advice: One line about the meaning of the worst value and what to do; None if nothing is wrong.
    """

    text: str
    worst: str | None
    advice: str | None = None

    @property
    def is_good(self) -> bool:
        """Whether all values are acceptable."""
        return self.worst is None

    def __str__(self) -> str:
        return self.text


def verdict_of(values: Values) -> Verdict:
    """Verdict on the numbers of a score, by their keys."""
    found = [c for concerns in _CONCERNS for c in concerns(values) if c.weight > 1.0]
    found.sort(key=lambda concern: -concern.weight)
    if found:
        text = "; ".join(concern.text for concern in found[:NAMED])
        return Verdict(text, found[0].key, _ADVICE.get(found[0].key))
    parts = ["nothing stands out"]
    if (share := _number(values, SHARE)) is not None:
        parts.append(f"followed {percent(share)} % of the time")
    if (error := _number(values, "position_error_mm.rms")) is not None:
        parts.append(f"tracking error {error:.3g} mm RMS")
        if (true := _number(values, "true_error_mm.rms")) is not None and true > _ERROR_MM:
            parts[-1] += f" at the encoders and {true:.3g} mm at the true tip"
    return Verdict(f"{parts[0]}: {', '.join(parts[1:])}" if parts[1:] else parts[0], None)


def _number(values: Values, key: str) -> float | None:
    value = values.get(key)
    return None if value is None or isinstance(value, str) else float(value)


def percent(share: float) -> str:
    """Text in percent, rounded down, so that "100" means the whole time."""
    return f"{math.floor(1000.0 * share + 1e-9) / 10.0:g}"


def _missing(values: Values) -> Iterator[Concern]:
    """Concern about unknown parts. It comes first, because values that depend on them are missing."""
    for key, what in (("session.missing", "not known here"), ("fixture.unscored", "not scored")):
        if told := values.get(key):
            text = f"{what}: {told}; give the file that has it: teleop evaluate --parts FILE.py"
            yield Concern(math.inf, key, text)
            return


def _gap(values: Values) -> Iterator[Concern]:
    """Concern about a time without messages, which other values would blame on the hand or on the machine."""
    if (gap := _number(values, "gap.longest_s")) is not None:
        at = _number(values, "gap.at_s") or 0.0
        yield Concern(_FIRST, "gap.longest_s", f"the recording has a gap of {gap:.2g} s, at {at:.3g} s")


def _halt(values: Values) -> Iterator[Concern]:
    """Concern about the time in which a fault or a stop kept the arm from following."""
    share, reason = _number(values, "halt.share") or 0.0, values.get("halt.reason")
    if share > 1.0 - _FOLLOWED:
        at = _number(values, "halt.at_s") or 0.0
        text = f"the arm was stopped for {100.0 * share:.3g} % of the time, from {at:.3g} s on: {reason}"
        yield Concern(_FIRST * 10.0, "halt.share", text)


def _drift(values: Values) -> Iterator[Concern]:
    """Concern about the error relative to the hand's asked position.

    The lag of filters is subtracted, since the command error contains it too.
    """
    key = "asked_error_mm.max"
    off, lag = _number(values, key), _number(values, "command_error_mm.max") or 0.0
    if off is not None:
        yield Concern((off - lag) / _DRIFT_MM, key, f"largest lag behind the hand {off:.3g} mm")


def _following(values: Values) -> Iterator[Concern]:
    share = _number(values, SHARE)
    if share is None:
        return
    shares = {text: _number(values, f"reach.{name}_share") for name, text in _CAUSES.items()}
    causes = [f"{100.0 * s:.1f} % {text}" for text, s in shares.items() if s and s >= _SHARE]
    text = f"followed {percent(share)} % of the time"
    text += f" ({', '.join(causes)})" if causes else ""
    yield Concern((1.0 - share) / (1.0 - _FOLLOWED), SHARE, text)


def _beyond(key: str, fine: float, text: str) -> Callable[[Values], Iterator[Concern]]:
    """Return a function that yields a concern about one number, which is inserted into the text."""

    def concern(values: Values) -> Iterator[Concern]:
        value = _number(values, key)
        if value is not None:
            yield Concern(value / fine, key, text.format(value))

    return concern


def _in_vain(values: Values) -> Iterator[Concern]:
    """Concern about a task without a successful attempt."""
    if (tried := _number(values, "task.attempts")) and not _number(values, "task.successes"):
        yield Concern(1.0 + tried, "task.successes", f"no success in {tried:.0f} attempts at the task")


def _messages(values: Values) -> Iterator[Concern]:
    """Concern about missing messages of all topics: messages that were lost, or never sent by a late stage."""
    missing, count, lost = (_of_topics(values, name) for name in ("gaps", "count", "lost"))
    if missing:
        share = missing / max(1, count + missing)
        text = f"{missing} messages missing ({100.0 * share:.2g} %)"
        text += f", {min(lost, missing)} of them lost on the way" if lost else ""
        yield Concern(share / _SHARE, "topics", text)


def _of_topics(values: Values, name: str) -> int:
    """Sum of a number over all topics, except topics of a simulated network, whose losses are configured."""
    return sum(
        int(value)
        for key, value in values.items()
        if key.startswith("topics.")
        and not key.startswith("topics.network/")
        and key.endswith(f".{name}")
        and isinstance(value, int | float)
    )


def _delay(values: Values) -> Iterator[Concern]:
    """Concern about delay in addition to the configured delay of a simulated network and of links."""
    key = "latency_ms.total.p99"
    asked = _number(values, "latency_ms.asked.p99") or 0.0
    if (whole := _number(values, key)) is not None:
        text = f"delay p99 {whole:.3g} ms, hand to setpoint"
        text += f", {asked:.3g} ms of it asked for" if asked else ""
        yield Concern((whole - asked) / _LATENCY_MS, key, text)


def _ticks(values: Values) -> Iterator[Concern]:
    """Concern about control ticks that were not in time because the machine was busy."""
    done = _number(values, "ticks.executed")
    for key, (fine, text) in _UNTIMELY.items():
        if done and (count := _number(values, key)):
            share = count / done
            yield Concern(share / fine, key, f"{text.format(count)} ({100.0 * share:.2g} %)")


def _created(values: Values) -> Iterator[Concern]:
    """Concern about output energy that exceeds the input energy of hand and slave, if both were recorded."""
    into, out = ([_number(values, f"passivity.{side}.{way}_mj") for side in ("hand", "slave")] for way in ("in", "out"))
    if None not in (*into, *out):
        taken, given = (sum(part or 0.0 for part in parts) for parts in (into, out))
        text = f"hand and slave gave {given:.3g} mJ, {given - taken:.3g} mJ more than they took"
        yield Concern((given - taken) / _CREATED_MJ, "passivity.slave.out_mj", text)


_UNTIMELY = {
    "ticks.made_up": (5e-3, "{:.0f} control ticks made up late, as on a busy machine"),
    "ticks.dropped": (_SHARE, "{:.0f} control ticks never executed"),
}
_CONCERNS: tuple[Callable[[Values], Iterator[Concern]], ...] = (
    _missing,
    _gap,
    _halt,
    _drift,
    _following,
    _in_vain,
    _messages,
    _ticks,
    _created,
    _delay,
    _beyond("position_error_mm.rms", _ERROR_MM, "tracking error {:.3g} mm RMS"),
    _beyond("fixture.penetration_max_mm", BOX_OVERSHOOT_MM, "fixture penetration {:.3g} mm"),
    _beyond("contact.feeding", 0.5, "non-passive contacts: {:.0f}"),
)
