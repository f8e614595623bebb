"""Studies with people: orders, what goes on where it was, who may ask what, and what is compared."""

import json
from collections import Counter
from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from teleop_console.drivers import Drivers
from teleop_console.link import ArmView, View
from teleop_core.base.errors import SessionError
from teleop_core.graph.topics import TASK_STATE
from teleop_lab.people.compare import comparison_page, comparison_table, people_dataset
from teleop_lab.people.conduct import score_all
from teleop_lab.people.journal import DONE, FAILED, Journal
from teleop_lab.people.people_page import PeoplePage
from teleop_lab.people.plan import TLX, Plan, conditions_of, read_plan
from teleop_lab.studies.summary import apart, median_of

FILE = Path(__file__).parents[2] / "config" / "studies" / "people_on_a_late_screen.yaml"
PERSON, WATCHES, STRANGER = 0, 1, -1
ANSWERS = {question.name: ["55"] for question in TLX}


@pytest.fixture(scope="module")
def plan() -> Plan:
    return read_plan(FILE)


@pytest.fixture
def journal(plan: Plan, tmp_path: Path) -> Journal:
    return Journal(tmp_path / "store", plan)


@pytest.fixture
def page(plan: Plan, journal: Journal) -> PeoplePage:
    drivers = Drivers()
    drivers.join(PERSON)
    drivers.join(WATCHES)
    return PeoplePage(drivers, plan, journal)


def go(page: PeoplePage, step: str, at: object = "", asked_by: int = PERSON, **words: list[str]) -> Any:
    """What a participant's page is told after it has asked to go on."""
    return page.answer("/go", {"step": [step], "at": [str(at)], **words}, asked_by)[1]


def act(page: PeoplePage, what: str, key: str = "", **words: str) -> tuple[int, object]:
    """Status and text of what who conducts is told."""
    query = {"what": [what], "key": [key or page.key], **{name: [word] for name, word in words.items()}}
    status, told = page.answer("/act", query, STRANGER)
    return int(status), told


# -- orders ------------------------------------------------------------------------------------


@pytest.mark.parametrize("count", range(2, 10))
def test_in_a_latin_square_each_condition_has_each_place_and_follows_each_other_equally_often(count: int) -> None:
    rows = [conditions_of(i, count, "latin") for i in range(count * (1 + count % 2))]
    for row in rows:
        assert sorted(row) == list(range(count))
    assert len(set(Counter((place, one) for row in rows for place, one in enumerate(row)).values())) == 1
    follows = Counter(pair for row in rows for pair in pairwise(row))
    assert len(follows) == count * (count - 1)
    assert len(set(follows.values())) == 1


def test_a_shuffled_order_is_the_same_for_a_participant_always_and_not_for_all() -> None:
    orders = [conditions_of(i, 5, "shuffled") for i in range(10)]
    assert orders == [conditions_of(i, 5, "shuffled") for i in range(10)]
    assert len(set(map(tuple, orders))) > 5
    assert all(sorted(order) == list(range(5)) for order in orders)


def test_practice_comes_before_the_trials_that_count_and_the_recording_names_what_it_is(plan: Plan) -> None:
    trials = plan.trials("p02")
    assert [trial.repetition for trial in trials] == [0, 1, 2, 0, 1, 2]
    assert [trial.asks for trial in trials] == [False, False, True] * 2
    made = plan.configuration("p02", trials[1])
    assert made.groups["operator"].kind.kind == "remote"
    assert "participant p02, trial 2, repetition 1" in made.groups["teleop"].description
    assert made.groups["display"].latency == trials[1].values["display.latency"]


# -- going on ----------------------------------------------------------------------------------


def test_a_participant_goes_from_consent_by_trials_and_questions_to_thanks_and_on_after_any_crash(
    plan: Plan, page: PeoplePage, journal: Journal
) -> None:
    steps = []
    while (now := go(page, "", ""))["step"] != "thanks":
        steps.append(now["step"])
        assert Journal(journal.folder, plan).step("p01") == journal.step("p01")  # as after a crash here
        words: dict[str, Any] = ANSWERS if now["step"] == "questions" else {}
        told = go(page, now["step"], now.get("trial", ""), **words)
        if told["step"] == "runs":
            assert page.wait()[1].number == now["trial"]
            assert Journal(journal.folder, plan).step("p01")[1] == journal.step("p01")[1]  # begins again
            page.close(DONE, "", "trial")
    assert steps == ["consent", *["begin"] * 3, "questions", *["begin"] * 3, "questions"]
    assert journal.answers("p01", 3) == dict.fromkeys(ANSWERS, 55.0)


def test_a_trial_ends_after_its_attempts_and_by_a_button(page: PeoplePage) -> None:
    go(page, "consent")
    go(page, "begin", 1)
    page.wait()
    state = np.zeros(len(TASK_STATE.columns))
    view = View(arms={"": ArmView({TASK_STATE.name: state})})
    assert not page.is_over(view)
    state[TASK_STATE.columns.index("attempts")] = 13.0
    assert not page.is_over(view)
    assert go(page, "", "")["tried"] == 13
    state[TASK_STATE.columns.index("attempts")] = 14.0
    assert page.is_over(view)
    state[:] = 0.0
    go(page, "runs", 1)
    assert page.is_over(view)


def test_a_failed_trial_waits_for_the_conductor_who_repeats_or_skips_it_with_a_reason(
    page: PeoplePage, journal: Journal
) -> None:
    go(page, "consent")
    go(page, "begin", 1)
    page.wait()
    page.close(FAILED, "the arms were stopped", "trial_01")
    assert go(page, "begin", 1)["step"] == "wait"
    assert act(page, "repeat", trial="1", reason="")[0] == 409
    assert act(page, "repeat", trial="1", reason="stopped too early")[0] == 200
    assert go(page, "", "")["step"] == "begin"
    act(page, "skip", trial="1", reason="no time")
    assert go(page, "", "")["trial"] == 2
    assert journal.event("p01", 1) == {"trial": 1, "state": "skipped", "reason": "no time"}
    act(page, "pause")
    assert go(page, "begin", 2)["step"] == "paused"
    act(page, "go_on")
    assert go(page, "begin", 2)["step"] == "runs"
    assert act(page, "choose", participant="p02")[0] == 409  # somebody is at it


def test_the_place_of_a_recording_is_never_one_that_was_begun_before(journal: Journal) -> None:
    first = journal.place("p01", 1)
    first.mkdir(parents=True)
    assert journal.place("p01", 1) == first.with_name("trial_01_2")


def test_a_store_of_another_study_is_refused_and_so_is_a_folder_with_something_else(
    plan: Plan, journal: Journal, tmp_path: Path
) -> None:
    with pytest.raises(SessionError, match="another study"):
        Journal(journal.folder, replace(plan, people=replace(plan.people, repetitions=5)))
    with pytest.raises(SessionError, match="other files"):
        Journal(Path(__file__).parent, plan)
    (journal.folder / "people.json").write_text("[")
    with pytest.raises(SessionError, match="cannot be used"):
        Journal(journal.folder, plan)


def test_a_disk_that_takes_nothing_is_told(journal: Journal) -> None:
    (journal.folder / "p01").touch()  # a file where a folder shall be
    with pytest.raises(SessionError, match="cannot be written"):
        journal.agree("p01")


# -- who may ask what --------------------------------------------------------------------------


@pytest.mark.parametrize("stranger", [WATCHES, STRANGER])
def test_pages_that_watch_go_on_with_nothing(page: PeoplePage, journal: Journal, stranger: int) -> None:
    status, _ = page.answer("/go", {"step": ["consent"], "at": [""]}, stranger)
    assert status == 409
    assert journal.step("p01")[0] == "consent"


def test_a_button_that_is_pressed_twice_or_on_an_old_page_does_nothing_more(page: PeoplePage, journal: Journal) -> None:
    go(page, "begin", 1)
    go(page, "runs")
    go(page, "close")
    assert journal.step("p01")[0] == "consent"
    go(page, "consent")
    for _ in range(3):
        go(page, "begin", 1)
    assert page.wait()[1].number == 1
    assert page._wishes.empty()
    page.close(DONE, "", "trial_01")
    go(page, "begin", 1)
    assert journal.step("p01")[1].number == 2  # type: ignore[union-attr]


@pytest.mark.parametrize("word", ["", "101", "-1", "nan", "1e1", "5.0", "٣", " 5", "0x1", "9" * 5000, "5\n"])
def test_an_answer_that_is_none_is_refused_and_nothing_is_kept(page: PeoplePage, journal: Journal, word: str) -> None:
    go(page, "consent")
    for number in (1, 2, 3):
        journal.note("p01", number, DONE)
    assert page.answer("/go", {"step": ["questions"], "at": ["3"], **ANSWERS, "effort": [word]}, PERSON)[0] == 409
    assert journal.step("p01")[0] == "questions"


@pytest.mark.parametrize("key", ["x", "", "é", "0" * 100_000])
def test_without_the_key_nobody_conducts_or_sees_what_was_done(page: PeoplePage, journal: Journal, key: str) -> None:
    for path in ("/act", "/conducting", "/table"):
        query = {"key": [key], "what": ["skip"], "trial": ["1"], "reason": ["a"]}
        assert page.answer(path, query, PERSON)[0] == 403
    assert not journal.rows()


@pytest.mark.parametrize(
    "words",
    [
        {"what": "choose", "participant": "../p01"},
        {"what": "choose", "participant": "p99"},
        {"what": "__class__"},
        {"what": "skip", "trial": "0", "reason": "a"},
        {"what": "skip", "trial": "1.0", "reason": "a"},
        {"what": "skip", "trial": "1", "reason": "a\nb"},
        {"what": "skip", "trial": "1", "reason": "a" * 201},
    ],
)
def test_who_conducts_is_checked_word_by_word_too(page: PeoplePage, journal: Journal, words: Mapping[str, str]) -> None:
    given = dict(words)
    assert act(page, given.pop("what"), **given)[0] == 409
    assert not journal.rows()


def test_no_page_is_told_the_key_and_a_participant_sees_no_scores(page: PeoplePage, journal: Journal) -> None:
    go(page, "consent")
    journal.note("p01", 1, DONE, bag="trial_01")
    journal.score("p01", 1, {"task.time_s": 1.25}, "fine")
    conducted = page.answer("/conducting", {"key": [page.key]}, STRANGER)[1]
    assert "1.25" in json.dumps(conducted)
    for told in (page.answer("/people", {}, PERSON), go(page, "", ""), conducted):
        assert page.key not in json.dumps(told)
    assert "1.25" not in json.dumps(page.answer("/people", {}, PERSON))
    assert "1.25" in str(page.answer("/table", {"key": [page.key]}, STRANGER)[1])


# -- what is compared --------------------------------------------------------------------------


def test_a_participant_s_value_is_the_mean_of_the_trials_that_count(plan: Plan, journal: Journal) -> None:
    for trial in plan.trials("p02"):  # p02 begins with the late screen
        journal.note("p02", trial.number, DONE, bag="b")
        time = {0: 100.0, 1: 1.0, 2: 2.0}[trial.repetition] + 10.0 * trial.condition
        journal.score("p02", trial.number, {"task.time_s": time}, "")
    journal.answer("p02", 3, dict.fromkeys(ANSWERS, 40.0))
    found = people_dataset(plan, journal)
    assert found["task.time_s"].dims == ("display.latency", "participant")
    assert found["task.time_s"].attrs["units"] == "s"
    assert found.sel(participant="p02")["task.time_s"].values.tolist() == [1.5, 11.5]
    assert np.isnan(found.sel(participant="p01")["task.time_s"].values).all()
    late = found.sel({"participant": "p02", "display.latency": 0.333})
    assert (float(late["effort"]), int(late["trials"])) == (40.0, 2)


def test_a_recording_that_cannot_be_scored_says_why_and_the_study_goes_on(plan: Plan, journal: Journal) -> None:
    journal.note("p01", 1, DONE, bag="none")
    score_all(plan, journal)
    assert "cannot be scored" in journal.event("p01", 1)["verdict"]


@pytest.mark.slow
def test_people_who_do_as_the_simulated_operator_score_as_it_does(plan: Plan, journal: Journal) -> None:
    """The same sessions, recorded as trials, have the same scores to the bit, and nothing is between both."""
    import teleop_core as tc

    study = replace(plan.study, seeds=(1, 2), settings={"teleop.duration": 5.0})
    same = replace(plan, study=study, people=replace(plan.people, participants=2, practice=0, repetitions=1))
    store = Journal(journal.folder.with_name("same"), same)
    for seed, code in enumerate(same.codes, 1):
        for trial in same.trials(code):
            out = store.place(code, trial.number)
            out.parent.mkdir(exist_ok=True)
            tc.run("point", seed=seed, settings={**study.settings, **trial.values}, out=out)
            store.note(code, trial.number, DONE, bag=out.name)
    score_all(same, store)
    people, simulated = people_dataset(same, store), study.run(jobs=1)
    for metric in study.metrics:
        np.testing.assert_array_equal(people[metric].values, simulated[metric].values)
    assert "0 (" in comparison_table(same, people, simulated)
    assert "simulated operator" in comparison_page(same, people, simulated)


def test_the_interval_of_a_difference_holds_it_in_nineteen_of_twenty_samples() -> None:
    rng, held, count = np.random.default_rng(1), 0, 200
    for _ in range(count):
        found = apart(rng.normal(1.0, 1.0, 25), rng.normal(0.0, 2.0, 25))
        held += found.low <= 1.0 <= found.high
    assert 0.90 <= held / count <= 1.0
    assert median_of(np.array([1.0, 5.0, 3.0, np.nan])).value == 3.0
    assert apart(np.array([np.nan]), np.ones(3)).samples == 0
