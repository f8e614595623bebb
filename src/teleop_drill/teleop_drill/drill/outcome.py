"""Outcome: the measurements of one fault, and the result of their check."""

import math
from dataclasses import dataclass, field

from teleop_core.graph.operation import State
from teleop_core.slave.operation import Fault
from teleop_drill.drill.exercise import Cure, Exercise
from teleop_drill.drill.judging import Measured

_SHORT = 20  # largest number of characters of a note that is shown beside the state


@dataclass(kw_only=True)
class FaultOutcome:
    """One fault and the reaction of the session.

    Attributes:
        exercise: The exercise that was run.
        detected: Time until a node reported the fault [s]; NaN if no node reported it.
        told_by: First node that reported the fault, with the text of the report.
        told: Time until ``slave/operation`` reported the expected state [s]; None without this report.
        state: Operating state that followed; None if the slave had ended.
        fault: Fault that the slave reported.
        is_braked: Whether the drives were off after the fault, and brakes held the arm.
        measures: All measured numbers with their bounds, by name.
        recording: Text about the state of the recording; empty before the recording is checked.
        is_recorded: Whether the recording is as expected.
        recovered: Time from the end of the fault until the arm followed again [s]; NaN if never.
        cure: Actions that the arm needed to follow again.
        note: Further remarks.
        load: Load of the machine at the begin of the fault, divided by the number of its cores.
    """

    exercise: Exercise
    detected: float = math.nan
    told_by: str = ""
    told: float | None = None
    state: State | None = None
    fault: Fault = Fault.NONE
    is_braked: bool = False
    measures: dict[str, Measured] = field(default_factory=dict)
    recording: str = ""
    is_recorded: bool = True
    recovered: float = math.nan
    cure: Cure = Cure.NOTHING
    note: str = ""
    load: float = 0.0
    extra: dict[str, float] = field(default_factory=dict)

    def measured(self, name: str) -> Measured:
        """Return a number by its name; NaN if it was not measured."""
        return self.measures.get(name, Measured(name, "", math.nan))

    def note_loss(self, seconds: float) -> None:
        """Store the duration [s] of messages that the drill's own tap received but the recording lacks."""
        text = "{0:.2f} s of a topic that the drill received are not recorded, at most {1:.2f} s"
        most = self.exercise.lost
        self.measures["lost_s"] = Measured("lost_s", text, seconds, most, scale=1.0)

    def failures(self) -> list[str]:
        """Texts of all unexpected results."""
        asked, found = self.exercise, []
        if self.state not in asked.states:
            wanted = " or ".join(_state(state) for state in asked.states)
            found.append(f"{_state(self.state)}, not {wanted}")
        if asked.faults and self.fault not in asked.faults:
            wanted = " or ".join(fault.word for fault in asked.faults)
            found.append(f"reported {self.fault.word}, not {wanted}")
        if asked.brakes and not self.is_braked:
            found.append("the drives are on, must be off, and the brakes on")
        if asked.said and self.note != asked.said:
            found.append(f"answered {self.note or 'nothing'!r}, not {asked.said!r}")
        found += [one.failure for one in self.measures.values() if one.failure]
        if not self.is_recorded:
            found.append(f"recording: {self.recording}")
        if math.isnan(self.recovered):
            found.append("the arm did not recover")
        elif self.cure not in asked.cures:
            wanted = " or ".join(cure.value for cure in asked.cures)
            found.append(f"recovered by {self.cure.value}, not {wanted}")
        return found

    @property
    def state_text(self) -> str:
        """Text with the state, the fault, and a short note if there is one: ``"PAUSED: silence"``."""
        text = _state(self.state)
        text = text if self.fault is Fault.NONE else f"{text}: {self.fault.word}"
        return f"{text} ({self.note})" if 0 < len(self.note) < _SHORT else text

    def to_json(self) -> dict[str, object]:
        """The whole outcome in SI units, for a file."""
        asked = self.exercise
        return {
            "fault": asked.name, "text": asked.text, "is_passed": not self.failures(),
            "failures": self.failures(), "detected_s": _number(self.detected),
            "told_by": self.told_by, "state": _state(self.state), "told": self.fault.word,
            "measured": {one.name: one.to_json() for one in self.measures.values()},
            "recording": self.recording,
            "recovered_s": _number(self.recovered), "cure": self.cure.value,
            "motion": asked.motion.name.lower(), "note": self.note, "load": self.load,
            **{name: _number(value) for name, value in self.extra.items()},
        }  # fmt: skip


def _state(state: State | None) -> str:
    return "gone" if state is None else state.name


def _number(value: float) -> float | None:
    return round(value, 9) if math.isfinite(value) else None
