"""Conduct: runs a study with people, trial after trial, while the console's page shows it."""

from functools import partial
from pathlib import Path

from teleop_console.answers import Situation
from teleop_console.console_session import show_session
from teleop_console.server import ConsoleServer
from teleop_core.base.errors import TeleopError
from teleop_core.session.recording import open_recording
from teleop_lab.people.journal import DONE, FAILED, Journal
from teleop_lab.people.people_page import PeoplePage
from teleop_lab.people.plan import Plan

IF_STOPPED = "The arm is stopped. Call the person who conducts the study."


def serve(plan: Plan, journal: Journal, port: int, host: str, token: str) -> tuple[ConsoleServer, PeoplePage]:
    """Start the server of a study's pages; returns the server and the pages.

    Raises:
        TeleopError: The reasons of :class:`~teleop_console.server.ConsoleServer`.
    """
    server = ConsoleServer(port, host, token, form=partial(PeoplePage, plan=plan, journal=journal))
    page = server.answers.form
    assert isinstance(page, PeoplePage)
    return server, page


def conduct(server: ConsoleServer, page: PeoplePage, plan: Plan, journal: Journal) -> None:
    """Run each trial that a page begins, until Ctrl-C; a trial is recorded and scored like any session."""
    score_all(plan, journal)
    while True:
        server.answers.situation = Situation(can_stop=False, chooses=True)
        code, trial = page.wait()
        out = journal.place(code, trial.number)
        try:
            made = plan.configuration(code, trial)
            show_session(server, made, out, page.is_over, if_stopped=IF_STOPPED)
            page.close(*((FAILED, "the arms were stopped") if page.is_stopped else (DONE, "")), out.name)
        except TeleopError as error:
            print(f"trial {trial.number} of {code}: {error}", flush=True)
            page.close(FAILED, str(error), out.name)
        server.answers.situation = Situation(can_stop=False, chooses=True)
        score_all(plan, journal)


def score_all(plan: Plan, journal: Journal) -> None:
    """Score all finished trials that have no scores yet."""
    for code in plan.codes:
        for trial in plan.trials(code):
            event = journal.event(code, trial.number)
            if event.get("state") == DONE and "scores" not in event:
                scores, verdict = scores_of(plan, journal.folder / code / event["bag"])
                journal.score(code, trial.number, scores, verdict)


def scores_of(plan: Plan, bag: Path) -> tuple[dict[str, float | None], str]:
    """Return the compared scores of a recording, and its verdict; without scores, the text is the reason."""
    try:
        score = open_recording(bag).score()
        return {metric: score.value(metric) for metric in plan.study.metrics}, score.verdict.text
    except (TeleopError, OSError) as error:
        return {}, f"cannot be scored: {error}"
