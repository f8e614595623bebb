"""Pages: the participant's page and the conductor's page of a study, and all requests of both pages."""

import http
import queue
import secrets
import threading
from collections.abc import Callable, Mapping
from dataclasses import asdict
from pathlib import Path
from urllib.parse import quote

from teleop_console.drivers import Drivers
from teleop_console.link import View
from teleop_console.start import Body, Query, Told
from teleop_console.status import situation
from teleop_core.base.errors import ParameterError, TeleopError, UnknownNameError
from teleop_core.graph.topics import TASK_STATE
from teleop_lab.people.journal import AGAIN, DONE, SKIPPED, Journal
from teleop_lab.people.plan import Plan, Trial

_LONGEST = 200  # largest number of characters of a reason
_TRIED = TASK_STATE.columns.index("attempts")
_CONDUCT = """<!doctype html><html lang="en"><head><meta charset="utf-8"><title>Conductor</title>
<meta name="viewport" content="width=device-width"><link rel="icon" href="data:,">
<link rel="stylesheet" href="teleop.css"></head>
<body class="t-conducts"><script src="teleop.js"></script></body></html>"""


class PeoplePage:
    """Content and requests of both pages; methods may be called from any thread.

    The participant's page shows the next step. It may begin this step if it is the page that drives. The conductor
    needs a key, which no answer contains.

    Args:
        drivers: Object that knows which page is the participant's.
        plan: Plan of the study.
        journal: Journal of the study.

    Attributes:
        key: Secret of the conductor.
        is_stopped: Whether the arms of the present or last session are stopped.
    """

    script, style = Path(__file__).with_name("people.js"), Path(__file__).with_name("people.css")
    documents: Mapping[str, bytes] = {"/conduct": _CONDUCT.encode()}

    def __init__(self, drivers: Drivers, plan: Plan, journal: Journal) -> None:
        self.key = secrets.token_urlsafe(16)
        self._drivers, self._plan, self._journal = drivers, plan, journal
        self._lock, self._wishes = threading.RLock(), queue.SimpleQueue[tuple[str, Trial]]()
        self._running: tuple[str, Trial] | None = None
        self._ends, self._is_paused, self._tried = threading.Event(), False, 0
        self.is_stopped = False
        self._steps: Mapping[str, Callable[[Query, Trial | None], None]] = {
            "consent": lambda query, trial: self._journal.agree(self._journal.now),
            "begin": self._begin,
            "questions": self._keep,
            "runs": lambda query, trial: self._ends.set(),
        }
        self._acts: Mapping[str, Callable[[Query], None]] = {
            "choose": self._choose,
            "pause": lambda query: self._pause(is_paused=True),
            "go_on": lambda query: self._pause(is_paused=False),
            "end": lambda query: self._ends.set(),
            "repeat": lambda query: self._judge(query, AGAIN),
            "skip": lambda query: self._judge(query, SKIPPED),
        }

    @property
    def paths(self) -> frozenset[str]:
        """Paths of all requests: two for the participant, three for the conductor."""
        return frozenset({"/people", "/go", "/conducting", "/act", "/table"})

    def link(self, url: str) -> str:
        """Address of the conductor's page, made from the address of the participant's page."""
        address, _, query = url.partition("?")
        return f"{address}conduct{'?' + query if query else ''}#{quote(self.key)}"

    def answer(self, path: str, query: Query, page: int, body: Body = bytes) -> Told:
        """Check every parameter of a request, and return the answer."""
        del body
        try:
            with self._lock:
                if path == "/people":
                    return http.HTTPStatus.OK, self._shown()
                if path == "/go":
                    return self._go(query, page)
                if not secrets.compare_digest(_word(query, "key").encode(), self.key.encode()):
                    return http.HTTPStatus.FORBIDDEN, "This is for who conducts the study."
                if path == "/act":
                    self._act(query)
                return http.HTTPStatus.OK, self._table() if path == "/table" else self._conducted()
        except TeleopError as error:
            return http.HTTPStatus.CONFLICT, str(error)

    # -- what runs -------------------------------------------------------------------------------

    def wait(self) -> tuple[str, Trial]:
        """Wait until a trial begins; return the participant's code and the trial."""
        code, trial = self._wishes.get()
        self._ends.clear()
        self._tried, self.is_stopped = 0, False
        return code, trial

    def is_over(self, view: View) -> bool:
        """Whether a trial is over, because of its attempts or because a person pressed a button."""
        told = [arm.get(TASK_STATE) for arm in view.arms.values()]
        self._tried = sum(int(one[_TRIED]) for one in told if one is not None)
        self.is_stopped = situation(view).is_stopped
        return self._ends.is_set() or 0 < self._plan.people.attempts <= self._tried

    def close(self, state: str, reason: str, bag: str) -> None:
        """Record the state of the trial that ran, with the reason and the name of its recording."""
        with self._lock:
            assert self._running is not None
            code, trial = self._running
            self._journal.note(code, trial.number, state, bag=bag, reason=reason)
            self._running = None

    # -- the participant -------------------------------------------------------------------------

    def _step(self) -> tuple[str, Trial | None]:
        if self._running is not None:
            return "runs", self._running[1]
        step, trial = self._journal.step(self._journal.now)
        return ("paused" if self._is_paused and step == "begin" else step), trial

    def _shown(self) -> Mapping[str, object]:
        step, trial = self._step()
        shown: dict[str, object] = {"step": step, "title": self._plan.people.title, "participant": self._journal.now}
        if step == "consent":
            shown["text"] = self._plan.people.consent
        if trial is not None:
            count = len(self._plan.trials(self._journal.now))
            shown |= {"trial": trial.number, "trials": count, "is_practice": trial.repetition == 0}
            shown |= {
                "text": self._plan.people.instructions,
                "tried": self._tried,
                "attempts": self._plan.people.attempts,
            }
        if step == "questions":
            shown["questions"] = [asdict(question) for question in self._plan.questions]
        return shown

    def _go(self, query: Query, page: int) -> Told:
        """Begin the step that a page shows; a second press of the button has no effect."""
        if _word(query, "step") == "take":
            self._drivers.take(page)
        if not self._drivers.may_drive(page):
            return http.HTTPStatus.CONFLICT, "Another page is the participant's. Take control first."
        step, trial = self._step()
        at = "" if trial is None else str(trial.number)
        if (_word(query, "step"), _word(query, "at")) == (step, at) and step in self._steps:
            self._steps[step](query, trial)
        return http.HTTPStatus.OK, self._shown()

    def _begin(self, query: Query, trial: Trial | None) -> None:
        del query
        assert trial is not None
        self._running = self._journal.now, trial
        self._wishes.put(self._running)

    def _keep(self, query: Query, trial: Trial | None) -> None:
        assert trial is not None
        answers = {}
        for question in self._plan.questions:
            word = _word(query, question.name)
            if not (word.isascii() and word.isdecimal() and len(word) < 4 and int(word) <= 100):
                raise ParameterError(question.name, word, "a whole number, 0 to 100")
            answers[question.name] = float(word)
        self._journal.answer(self._journal.now, trial.number, answers)

    # -- who conducts ----------------------------------------------------------------------------

    def _act(self, query: Query) -> None:
        what = _word(query, "what")
        if what not in self._acts:
            raise UnknownNameError("action", what, self._acts)
        self._acts[what](query)

    def _choose(self, query: Query) -> None:
        code = _word(query, "participant")
        if code not in self._plan.codes:
            raise UnknownNameError("participant", code, self._plan.codes)
        if self._running is not None:
            raise ParameterError("participant", code, "chosen after the running trial has ended")
        self._journal.choose(code)

    def _pause(self, *, is_paused: bool) -> None:
        self._is_paused = is_paused

    def _judge(self, query: Query, state: str) -> None:
        """Set a trial to be repeated or skipped, for a reason that the conductor gives."""
        code, word, reason = self._journal.now, _word(query, "trial"), _word(query, "reason").strip()
        numbers = [str(trial.number) for trial in self._plan.trials(code)]
        if word not in numbers or (self._running and self._running[1].number == int(word)):
            raise ParameterError("trial", word, f"a trial from 1 to {len(numbers)} that is not running")
        if not 0 < len(reason) <= _LONGEST or not reason.isprintable():
            raise ParameterError("reason", reason, f"a line of 1 to {_LONGEST} characters")
        self._journal.note(code, int(word), state, reason=reason)

    def _conducted(self) -> Mapping[str, object]:
        code, (step, trial) = self._journal.now, self._step()
        rows = [row for row in self._journal.rows() if row["participant"] == code]
        states = {row["trial"]: row for row in rows}
        own = [
            {"number": t.number, "is_practice": t.repetition == 0, "values": dict(t.values), **states.get(t.number, {})}
            for t in self._plan.trials(code)
        ]
        everybody = []
        for one in self._plan.codes:
            done = [self._journal.event(one, t.number).get("state") in {DONE, SKIPPED} for t in self._plan.trials(one)]
            everybody.append({"code": one, "done": sum(done), "trials": len(done)})
        return {
            "title": self._plan.people.title, "participant": code, "step": step, "trial": trial and trial.number,
            "tried": self._tried, "attempts": self._plan.people.attempts, "is_paused": self._is_paused,
            "everybody": everybody, "own": own, "metrics": list(self._plan.study.metrics),
        }  # fmt: skip

    def _table(self) -> str:
        import pandas

        return pandas.DataFrame(self._journal.rows()).to_csv(index=False)


def _word(query: Query, name: str) -> str:
    """First value of a parameter of the request; empty if the request does not contain the parameter."""
    return next(iter(query.get(name, ())), "")
