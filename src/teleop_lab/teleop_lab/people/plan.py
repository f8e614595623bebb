"""Plan: trials of a study's participants, their order, and the questions."""

import random
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path

from teleop_core.base.errors import ParameterError
from teleop_core.base.parameters import Within, build, parameter, specs
from teleop_core.base.texts import LONGEST_LINE
from teleop_core.evaluation.score import keys
from teleop_core.graph.layers import SESSION
from teleop_core.session.api import Setting, configuration
from teleop_core.session.configuration import Configuration
from teleop_lab.studies.study import Study, named, read_entries, read_study

PEOPLE = "people"
MOST = 200
"""Largest number of participants, and of trials of one participant."""
_TEXTS = {"title": 200, "consent": 10_000, "instructions": 2_000, "operator": 100}
"""Largest length of each text that a plan must contain."""


@dataclass(frozen=True)
class Question:
    """A question that is answered on a scale from 0 to 100.

    Attributes:
        name: Name of the question's column in tables.
        text: Text of the question.
        low: Label at 0.
        high: Label at 100.
    """

    name: str
    text: str
    low: str
    high: str


TLX = (
    Question("mental", "Mental demand: how mentally demanding was the task?", "very low", "very high"),
    Question("physical", "Physical demand: how physically demanding was the task?", "very low", "very high"),
    Question("temporal", "Temporal demand: how hurried or rushed was the pace of the task?", "very low", "very high"),
    Question(
        "performance",
        "Performance: how successful were you in accomplishing what you were asked to do?",
        "perfect",
        "failure",
    ),
    Question(
        "effort",
        "Effort: how hard did you have to work to accomplish your level of performance?",
        "very low",
        "very high",
    ),
    Question(
        "frustration",
        "Frustration: how insecure, discouraged, irritated, stressed and annoyed were you?",
        "very low",
        "very high",
    ),
)
"""Questions of NASA-TLX (Hart and Staveland 1988). The raw score is the mean of the six answers (Hart 2006)."""


@dataclass(frozen=True)
class Trial:
    """One trial of a participant.

    Attributes:
        number: Position of the trial in the participant's order, starting with 1.
        condition: Index of the trial's combination of swept values in the study.
        values: Swept values of the trial.
        repetition: Number of the trial within its condition, starting with 1; 0 for practice.
        asks: Whether questions follow the trial; they are left out if the trial was skipped.
    """

    number: int
    condition: int
    values: Mapping[str, Setting]
    repetition: int
    asks: bool


@dataclass(frozen=True, kw_only=True)
class PeopleParameters:
    """Entries of a study's file below ``people``, without its questions."""

    title: str = parameter("", doc="heading of the participants' page")
    consent: str = parameter("", doc="what a participant agrees to, before anything else")
    instructions: str = parameter("", doc="what is to be done, before each trial")
    participants: int = parameter(12, Within(1, MOST), "how many there are, at most")
    practice: int = parameter(1, Within(0, MOST), "trials of each condition before those that count")
    repetitions: int = parameter(3, Within(1, MOST), "trials of each condition that count")
    attempts: int = parameter(0, Within(0, MOST), "after so many a trial ends; 0: after its time")
    order: str = parameter("latin", choices=("fixed", "shuffled", "latin"), doc="of the conditions")
    operator: str = parameter("remote", doc="kind of the operator that a person is")
    duration: float = parameter(
        0.0, Within(0.1, 3600.0, "s"), "longest time of a trial; 0: as the study's sessions", off=0.0
    )
    ask: str = parameter("condition", choices=("trial", "condition", "end"), doc="after what the questions come")

    def __post_init__(self) -> None:
        for name, longest in _TEXTS.items():
            text = getattr(self, name)
            if not 0 < len(text.strip()) <= longest:
                raise ParameterError(f"{PEOPLE}.{name}", text, f"a text of at most {longest} characters")


@dataclass(frozen=True)
class Plan:
    """Plan of a study with people.

    Attributes:
        study: Study with the conditions and the compared scores.
        people: Entries of the study's file below ``people``.
        questions: Questions after trials.
    """

    study: Study
    people: PeopleParameters
    questions: Sequence[Question]

    @property
    def codes(self) -> tuple[str, ...]:
        """Codes of the participants: p01, p02 and so on."""
        return tuple(f"p{number:02d}" for number in range(1, self.people.participants + 1))

    def trials(self, code: str) -> list[Trial]:
        """Trials of a participant, in order."""
        swept = self.study.swept
        every = [dict(zip(swept, values, strict=True)) for values in product(*swept.values())]
        order = conditions_of(self.codes.index(code), len(every), self.people.order)
        repetitions = [*[0] * self.people.practice, *range(1, self.people.repetitions + 1)]
        count, found = len(order) * len(repetitions), list[Trial]()
        for condition in order:
            for repetition in repetitions:
                number, last = len(found) + 1, repetition == self.people.repetitions
                asks = {"trial": repetition > 0, "condition": last, "end": number == count}[self.people.ask]
                asks = asks and bool(self.questions)
                found.append(Trial(number, condition, every[condition], repetition, asks))
        return found

    def configuration(self, code: str, trial: Trial) -> Configuration:
        """Configuration of a trial; the recording contains the number of the trial.

        Raises:
            TeleopError: The trial cannot run.
        """
        about = f"study {self.people.title!r}, participant {code}, trial {trial.number}, repetition {trial.repetition}"
        own: dict[str, Setting] = {"operator.kind": self.people.operator, f"{SESSION}.description": about}
        if self.people.duration:
            own[f"{SESSION}.duration"] = self.people.duration
        return configuration(self.study.scenario, settings={**self.study.settings, **trial.values, **own})


def conditions_of(participant: int, count: int, order: str) -> list[int]:
    """Order of the conditions for a participant.

    Args:
        participant: Number of the participant, starting with 0.
        count: Number of conditions.
        order: One of fixed, shuffled and latin. The order of ``shuffled`` depends only on the participant's number.

    Source:
        Williams 1949: a square in which each condition follows each other condition equally often. With an odd number
        of conditions every second round of rows is read backwards.
    """
    if order == "fixed":
        return list(range(count))
    if order == "shuffled":
        found = list(range(count))
        random.Random(participant).shuffle(found)
        return found
    first = [(i + 1) // 2 if i % 2 else -(i // 2) for i in range(count)]
    row = [(one + participant) % count for one in first]
    return row[::-1] if count % 2 and participant // count % 2 else row


def read_plan(path: Path | str) -> Plan:
    """Read a plan from the YAML file of a study with an entry ``people``.

    Raises:
        TeleopError: The file cannot be read or contains a wrong entry; no session was started.
    """
    study = read_study(path)
    content = named(read_entries(path), PEOPLE)
    if not content:
        known = ", ".join((*(spec.name for spec in specs(PeopleParameters)), "questions"))
        raise ParameterError(PEOPLE, content, f"an entry of {Path(path).name} with {known}")
    questions = _questions(content.pop("questions", []))
    texts = {name: one.strip() if isinstance(one, str) else one for name, one in content.items()}
    plan = Plan(study, build(PeopleParameters, texts, f"{PEOPLE}."), questions)
    trials = plan.trials(plan.codes[0])
    if len(trials) > MOST:
        raise ParameterError("people.repetitions", plan.people.repetitions, f"small enough for at most {MOST} trials")
    study.points()  # raises an error if a trial cannot run
    for trial in {trial.condition: trial for trial in trials}.values():
        stages = plan.configuration(plan.codes[0], trial).groups
        if plan.people.attempts and "task" not in stages:
            raise ParameterError(
                "people.attempts",
                plan.people.attempts,
                "0 in a session without the stage `task`, which counts attempts",
            )
    return plan


def _questions(given: object) -> tuple[Question, ...]:
    needs = (
        f"a list of `tlx`, and of questions with texts name, text, low and high of {LONGEST_LINE} characters at most"
    )
    if not isinstance(given, list) or len(given) > MOST:
        raise ParameterError("people.questions", given, needs)
    found = list[Question]()
    for one in given:
        if one == "tlx":
            found += TLX
            continue
        texts = list(one.values()) if isinstance(one, dict) and set(one) == {"name", "text", "low", "high"} else [""]
        if not all(isinstance(text, str) and 0 < len(text.strip()) <= LONGEST_LINE for text in texts):
            raise ParameterError("people.questions", one, needs)
        found.append(Question(**one))
    names = [question.name for question in found]
    taken = {name for key in keys() for name in key.names()} | {"participant", "trial", "condition", "repetition"}
    for name in names:
        if names.count(name) > 1 or name in taken or not name.isidentifier():
            raise ParameterError("name of a question", name, "a word of letters, digits and _, of one question alone")
    return tuple(found)
