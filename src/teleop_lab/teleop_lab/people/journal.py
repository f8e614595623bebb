"""Journal: finished steps of a study's participants; each step is written to disk immediately."""

import hashlib
import json
import threading
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from teleop_core.base.errors import SessionError
from teleop_lab.people.plan import Plan, Trial
from teleop_lab.studies.store import write_whole

FORMAT = 1
DONE, SKIPPED, AGAIN, FAILED = "done", "skipped", "again", "failed"
"""State of a trial. A trial in ``again`` must be repeated; a trial in ``failed`` waits for the conductor's decision."""
_ABOUT, _FILE = "people.json", "journal.json"


class Journal:
    """Finished trials by participant. Each method that changes the journal writes the change to disk before it returns.

    Args:
        folder: Folder of the journal, created if missing; it contains a folder of recordings for each participant.
        plan: Plan of the study.

    Attributes:
        now: Code of the present participant.

    Raises:
        SessionError: The folder contains other files, or the journal of another plan or of a newer version.
    """

    def __init__(self, folder: Path, plan: Plan) -> None:
        self.folder, self._plan, self._lock = Path(folder), plan, threading.Lock()
        study = plan.study
        what = [
            study.scenario,
            dict(study.swept),
            dict(study.settings),
            plan.people.order,
            plan.people.practice,
            plan.people.repetitions,
        ]
        digest = hashlib.sha256(json.dumps(what, default=str).encode()).hexdigest()[:20]
        self._about = {"format": FORMAT, "plan": digest, "now": plan.codes[0]}
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            if (self.folder / _ABOUT).exists():
                self._about |= json.loads((self.folder / _ABOUT).read_text("utf-8"))
            elif any(self.folder.iterdir()):
                raise SessionError(f"{self.folder} contains other files; choose another folder")
            self._own = {code: self._read(code) for code in plan.codes}
        except (OSError, ValueError, TypeError) as error:
            raise SessionError(f"{self.folder} cannot be used for a study with people: {error}") from error
        if self._about["format"] != FORMAT or self._about["plan"] != digest:
            raise SessionError(f"{self.folder} belongs to another study or a newer version: its plan differs")
        self.now = str(self._about["now"])
        if self.now not in plan.codes:
            self.now = plan.codes[0]
        self.choose(self.now)

    def _read(self, code: str) -> dict[str, Any]:
        file = self.folder / code / _FILE
        found = json.loads(file.read_text("utf-8")) if file.exists() else {}
        return {"participant": code, "consent": "", "events": [], "answers": {}} | found

    def _write(self, code: str) -> None:
        self._save(self.folder / code / _FILE, self._own[code])

    def _save(self, file: Path, content: Mapping[str, Any]) -> None:
        try:
            with self._lock:
                file.parent.mkdir(exist_ok=True)
                write_whole(file, json.dumps(content, indent=1))
        except OSError as error:
            raise SessionError(f"{file} cannot be written: {error.strerror}; earlier answers are kept") from error

    def choose(self, code: str) -> None:
        """Make a participant the present one."""
        self.now = code
        self._save(self.folder / _ABOUT, self._about | {"now": code})

    def agree(self, code: str) -> None:
        """Record that a participant agrees to the consent text, with the time."""
        self._own[code]["consent"] = time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime())
        self._write(code)

    def note(self, code: str, trial: int, state: str, **facts: object) -> None:
        """Record the new state of a trial.

        Args:
            code: Code of the participant.
            trial: Number of the trial.
            state: One of :data:`DONE`, :data:`SKIPPED`, :data:`AGAIN` and :data:`FAILED`.
            facts: Further entries, such as ``bag``, ``scores``, ``verdict`` and ``reason``.
        """
        self._own[code]["events"].append({"trial": trial, "state": state, **facts})
        self._write(code)

    def score(self, code: str, trial: int, scores: Mapping[str, float | None], verdict: str) -> None:
        """Record the scores of the last run of a trial."""
        done = [one for one in self._own[code]["events"] if one["trial"] == trial and one["state"] == DONE]
        done[-1] |= {"scores": dict(scores), "verdict": verdict}
        self._write(code)

    def answer(self, code: str, trial: int, answers: Mapping[str, float]) -> None:
        """Record the answers to the questions after a trial."""
        self._own[code]["answers"][str(trial)] = dict(answers)
        self._write(code)

    def event(self, code: str, trial: int) -> Mapping[str, Any]:
        """Newest event of a trial; empty if the trial has no event."""
        events = [event for event in self._own[code]["events"] if event["trial"] == trial]
        return events[-1] if events else {}

    def answers(self, code: str, trial: int) -> Mapping[str, float]:
        """Answers to the questions after a trial; empty without answers."""
        found: Mapping[str, float] = self._own[code]["answers"].get(str(trial), {})
        return found

    def place(self, code: str, trial: int) -> Path:
        """Path for the recording of a trial that begins now; the directory does not exist yet."""
        name, tries = f"trial_{trial:02d}", 1
        while (path := self.folder / code / (name if tries == 1 else f"{name}_{tries}")).exists():
            tries += 1
        return path

    def step(self, code: str) -> tuple[str, Trial | None]:
        """Next step of a participant: ``consent``, ``begin`` or ``wait`` with a trial, ``questions``, ``thanks``."""
        if not self._own[code]["consent"]:
            return "consent", None
        trials = self._plan.trials(code)
        for trial in trials:
            state = self.event(code, trial.number).get("state", AGAIN)
            if state in {AGAIN, FAILED}:
                return ("begin" if state == AGAIN else "wait"), trial
            if trial.asks and not self.answers(code, trial.number) and self._was_done(code, trial, trials):
                return "questions", trial
        return "thanks", None

    def _was_done(self, code: str, trial: Trial, trials: Sequence[Trial]) -> bool:
        """Whether any of the trials to which the questions after a trial refer was done."""
        about = [one.number for one in trials[: trial.number] if one.condition == trial.condition]
        about = [trial.number] if self._plan.people.ask == "trial" else about
        return any(self.event(code, number).get("state") == DONE for number in about)

    def rows(self) -> list[dict[str, object]]:
        """Return a row for each trial with a state: participant, number, state, scores and answers."""
        found = []
        for code in self._plan.codes:
            for trial in self._plan.trials(code):
                if event := self.event(code, trial.number):
                    place = {"participant": code, "trial": trial.number, **trial.values, "repetition": trial.repetition}
                    scores = {name: event.get("scores", {}).get(name) for name in self._plan.study.metrics}
                    facts = {name: event.get(name, "") for name in ("state", "bag", "reason", "verdict")}
                    asked = self.answers(code, trial.number)
                    found.append(place | scores | {q.name: asked.get(q.name) for q in self._plan.questions} | facts)
        return found
