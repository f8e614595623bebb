"""Plan: what a study's participants do, in which order, and what they are asked."""

import random
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

from teleop_core.base.errors import ParameterError, UnknownNameError
from teleop_core.base.texts import LONGEST_LINE
from teleop_core.evaluation.score import keys
from teleop_core.graph.layers import SESSION
from teleop_core.session.api import Setting, configuration
from teleop_core.session.configuration import Configuration
from teleop_lab.studies.study import Study, named, read_entries, read_study

PEOPLE = "people"
ORDERS = ("fixed", "shuffled", "latin")
ASKS = ("trial", "condition", "end")
MOST = 200
"""Participants, and trials of one."""
_TEXTS = {"title": 200, "consent": 10_000, "instructions": 2_000}
_COUNTS = {"participants": (12, 1), "practice": (1, 0), "repetitions": (3, 1), "attempts": (0, 0)}
_KEYS = (*_TEXTS, *_COUNTS, "order", "operator", "duration", "ask", "questions")


@dataclass(frozen=True)
class Question:
    """A scale from 0 to 100.

    Attributes:
        name: Its column in tables.
        text: What is asked.
        low: Word at 0.
        high: Word at 100.
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
"""NASA-TLX (Hart and Staveland 1988). Its raw score is the mean of the six (Hart 2006)."""


@dataclass(frozen=True)
class Trial:
    """One trial of a participant.

    Attributes:
        number: Place in the participant's order, from 1 on.
        condition: Index among the study's combinations of swept values.
        values: Its swept values.
        repetition: Number among the trials of its condition, from 1 on; 0 for practice.
        asks: Whether questions follow it, if it was done.
    """

    number: int
    condition: int
    values: Mapping[str, Setting]
    repetition: int
    asks: bool


@dataclass(frozen=True)
class Plan:
    """What people do in a study.

    Attributes:
        study: Conditions, and the scores that are compared.
        title: Heading of the participants' page.
        consent: What a participant agrees to, before anything else.
        instructions: What is to be done, before each trial.
        participants: How many there are, at most.
        practice: Trials of each condition before those that count.
        repetitions: Trials of each condition that count.
        attempts: After so many a trial ends; 0: it lasts as long as the session.
        order: Of the conditions: fixed, shuffled or latin.
        operator: Kind of the operator that a person is.
        duration: Longest time of a trial [s].
        ask: After what the questions come.
        questions: Asked then.
    """

    study: Study
    title: str
    consent: str
    instructions: str
    participants: int
    practice: int
    repetitions: int
    attempts: int
    order: str
    operator: str
    duration: float
    ask: str
    questions: Sequence[Question]

    @property
    def codes(self) -> tuple[str, ...]:
        """Codes of the participants, p01 and so on."""
        return tuple(f"p{number:02d}" for number in range(1, self.participants + 1))

    def trials(self, code: str) -> list[Trial]:
        """Trials of a participant, in order."""
        swept = self.study.swept
        every = [dict(zip(swept, values, strict=True)) for values in product(*swept.values())]
        order = conditions_of(self.codes.index(code), len(every), self.order)
        repetitions = [*[0] * self.practice, *range(1, self.repetitions + 1)]
        count, found = len(order) * len(repetitions), list[Trial]()
        for condition in order:
            for repetition in repetitions:
                number, last = len(found) + 1, repetition == self.repetitions
                asks = {"trial": repetition > 0, "condition": last, "end": number == count}[self.ask]
                asks = asks and bool(self.questions)
                found.append(Trial(number, condition, every[condition], repetition, asks))
        return found

    def configuration(self, code: str, trial: Trial) -> Configuration:
        """What runs in a trial; the recording tells which one it was.

        Raises:
            TeleopError: It cannot run.
        """
        about = f"study {self.title!r}, participant {code}, trial {trial.number}, repetition {trial.repetition}"
        own: dict[str, Setting] = {"operator.kind": self.operator, f"{SESSION}.description": about}
        length: dict[str, Setting] = {f"{SESSION}.duration": self.duration}
        return configuration(self.study.scenario, settings={**self.study.settings, **trial.values, **own, **length})


def conditions_of(participant: int, count: int, order: str) -> list[int]:
    """Order of some conditions for a participant.

    Args:
        participant: Number from 0 on.
        count: How many conditions there are.
        order: One of :data:`ORDERS`; ``shuffled`` is the same for the same participant always.

    Source:
        Williams 1949: a square in which each condition follows each other one equally often; with
        an odd number of conditions every second round of rows is read backwards.
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
    """Plan of a YAML file: a study's, with an entry ``people``.

    Raises:
        TeleopError: The file cannot be read, or something in it is wrong; nothing was started.
    """
    study = read_study(path)
    content = named(read_entries(path), PEOPLE)
    if not content:
        raise ParameterError(PEOPLE, content, f"an entry of {Path(path).name} with {', '.join(_KEYS)}")
    for key in content:
        if key not in _KEYS:
            raise UnknownNameError(f"entry of {PEOPLE}", key, _KEYS)
    said: dict[str, Any] = {key: _text(content, key, longest) for key, longest in _TEXTS.items()}
    said |= {key: _count(content, key, *bounds) for key, bounds in _COUNTS.items()}
    duration = content.get("duration", study.settings.get(f"{SESSION}.duration"))
    if isinstance(duration, bool) or not isinstance(duration, int | float) or not 0.0 < duration <= 3600.0:
        raise ParameterError("people.duration", duration, "0 to 3600 s, here or as the study's duration")
    plan = Plan(
        study=study,
        **said,
        order=_choice(content, "order", ORDERS),
        ask=_choice(content, "ask", ASKS, "condition"),
        operator=_text(content, "operator", 100, "remote"),
        duration=float(duration),
        questions=_questions(content.get("questions", [])),
    )
    trials = plan.trials(plan.codes[0])
    if len(trials) > MOST:
        raise ParameterError("people.repetitions", plan.repetitions, f"so few that there are {MOST} trials at most")
    study.points()  # whatever cannot run is told here
    for trial in {trial.condition: trial for trial in trials}.values():
        stages = plan.configuration(plan.codes[0], trial).groups
        if plan.attempts and "task" not in stages:
            raise ParameterError("people.attempts", plan.attempts, "0 where no stage `task` counts them")
    return plan


def _text(content: Mapping[str, Any], key: str, longest: int, default: str | None = None) -> str:
    found = content.get(key, default)
    if not isinstance(found, str) or not 0 < len(found.strip()) <= longest:
        raise ParameterError(f"people.{key}", found, f"a text of at most {longest} characters")
    return found.strip()


def _count(content: Mapping[str, Any], key: str, default: int, least: int) -> int:
    found = content.get(key, default)
    if isinstance(found, bool) or not isinstance(found, int) or not least <= found <= MOST:
        raise ParameterError(f"people.{key}", found, f"a whole number, {least} to {MOST}")
    return found


def _choice(content: Mapping[str, Any], key: str, known: Sequence[str], default: str = "latin") -> str:
    found = content.get(key, default)
    if found not in known:
        raise UnknownNameError(f"people.{key}", found, known)
    return str(found)


def _questions(given: object) -> tuple[Question, ...]:
    needs = "a list of `tlx`, and of questions with name, text, low and high"
    if not isinstance(given, list) or len(given) > MOST:
        raise ParameterError("people.questions", given, needs)
    found = list[Question]()
    for one in given:
        if one == "tlx":
            found += TLX
            continue
        if not isinstance(one, dict) or set(one) != {"name", "text", "low", "high"}:
            raise ParameterError("people.questions", one, needs)
        found.append(Question(**{key: _text(one, key, LONGEST_LINE) for key in ("name", "text", "low", "high")}))
    names = [question.name for question in found]
    taken = {name for key in keys() for name in key.names()} | {"participant", "trial", "condition", "repetition"}
    for name in names:
        if names.count(name) > 1 or name in taken or not name.isidentifier():
            raise ParameterError("name of a question", name, "a word of letters, digits and _, of one question alone")
    return tuple(found)
