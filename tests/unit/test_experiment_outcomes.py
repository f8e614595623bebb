"""Outcomes of experiments: what counts as agreement, exact JSON, tables that say what they are."""

import ast
import inspect
import json
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from teleop_core.base.errors import ParameterError, UnknownNameError
from teleop_core.evaluation.figure import Figure
from teleop_lab import experiments
from teleop_lab.experiments import EXACT, Comparison, Experiment, Outcome, absolute, factor, percent
from teleop_lab.experiments.outcome import numbers, summary
from teleop_lab.experiments.results_page import experiments_page

positive = st.floats(1e-6, 1e6)
finite = st.floats(-1e9, 1e9)


def outcome(*rows: Comparison, notes: tuple[str, ...] = (), figures: tuple[Figure, ...] = ()) -> Outcome:
    return Outcome("trial", "a trial", "nobody 1900", 3, rows, figures, notes)


@given(positive, positive)
def test_prediction_agrees_within_a_share_whatever_its_sign(published: float, share: float) -> None:
    tolerance = percent(100.0 * share)
    for sign in (1.0, -1.0):
        assert tolerance.allows(sign * published, sign * published * (1.0 + 0.99 * share))
        assert not tolerance.allows(sign * published, sign * published * (1.0 + 1.01 * share))


@given(finite, positive)
def test_prediction_agrees_within_an_amount_on_both_sides(published: float, amount: float) -> None:
    tolerance = absolute(amount)
    assert tolerance.allows(published, published)
    for side in (1.0, -1.0):
        far = published + side * (1.01 * amount + 1e-6 * abs(published))
        assert not tolerance.allows(published, far)


@given(positive, st.floats(1.01, 100.0))
def test_factor_bounds_the_ratio_from_above_and_below(published: float, times: float) -> None:
    tolerance = factor(times)
    assert tolerance.allows(published, published * times * 0.999)
    assert tolerance.allows(published, published / times * 1.001)
    assert not tolerance.allows(published, published * times * 1.001)
    assert not tolerance.allows(published, published / times * 0.999)
    assert not tolerance.allows(published, -published)


def test_a_small_error_does_not_agree_with_a_large_one() -> None:
    # What the machine did is to be predicted, not beaten.
    assert Comparison(quantity="e", published=0.338, predicted=0.037, within=percent(15)).agrees is False


def test_exact_forgives_rounding_of_the_computer_alone() -> None:
    assert EXACT.allows(0.1 + 0.2, 0.3)
    assert EXACT.allows(0.0, -0.0)
    assert not EXACT.allows(360.0, 360.00001)


def test_difference_that_is_just_the_tolerance_agrees() -> None:
    assert absolute(0.25).allows(0.5, 0.25)
    assert percent(10.0).allows(1.0, 1.1)


@pytest.mark.parametrize("missing", ["published", "predicted", "within"])
def test_row_without_one_of_its_parts_is_not_judged(missing: str) -> None:
    whole: dict[str, Any] = {"published": 1.0, "predicted": 1.0, "within": EXACT}
    assert Comparison(quantity="q", **whole).agrees is True
    assert Comparison(quantity="q", **{**whole, missing: None}).agrees is None


@given(finite, finite)
def test_json_brings_back_the_same_bits(published: float, predicted: float) -> None:
    row = Comparison(quantity="q", unit="mm", published=published, predicted=predicted, within=EXACT)
    back = json.loads(json.dumps(outcome(row).to_json(), allow_nan=False))["rows"][0]
    assert back["published"] == published
    assert back["predicted"] == predicted
    assert back["difference"] == predicted - published
    assert back["agrees"] == row.agrees


def test_only_what_was_printed_counts_as_a_published_figure() -> None:
    whole: dict[str, Any] = {"published": 1.0, "predicted": 1.0, "within": EXACT}
    rows = [Comparison(quantity="q", basis=basis, **whole) for basis in ("printed", "law", "law", "goal")]
    found = outcome(*rows, Comparison(quantity="q", basis="goal", **whole | {"predicted": 2.0}))
    assert (found.agreeing, found.judged, found.count("goal")) == (1, 1, (1, 2))
    told = "1 of 1 published figures agree; 2 of 2 laws hold; 1 of 2 goals are kept"
    assert summary([found]) == f"{told}; 0 rows are not judged"
    with pytest.raises(ParameterError, match="basis"):
        Comparison(quantity="q", basis="guess", **whole)


class Typed(ast.NodeVisitor):
    """Lines of ``predicted=`` that hold typed numbers alone: literals, constants, conversions."""

    def __init__(self, source: str) -> None:
        self.lines: list[int] = []
        self.visit(ast.parse(source))

    def visit_keyword(self, node: ast.keyword) -> None:
        names = {n.id for n in ast.walk(node.value) if isinstance(n, ast.Name)}
        computed = {n for n in names if not n.lstrip("_").isupper() and n not in {"float", "len"}}
        is_none = isinstance(node.value, ast.Constant) and node.value.value is None
        if node.arg == "predicted" and not computed and not is_none:
            self.lines.append(node.value.lineno)
        self.generic_visit(node)


def test_no_experiment_compares_two_typed_numbers() -> None:
    for typed in ("36.0 - 6.0", "1e3 * MASSES['L2']", "float(_TIME_S)"):
        assert Typed(f"Comparison(published=30.0, predicted={typed})").lines == [1]
    for file in Path(inspect.getfile(experiments)).parent.glob("*.py"):
        assert not Typed(file.read_text()).lines, file


def test_row_is_found_by_quantity_and_group_and_a_wrong_name_lists_those_there_are() -> None:
    first, second = (Comparison(quantity="rms", group=group, predicted=1.0) for group in ("x", "y"))
    found = outcome(first, second)
    assert found.row("rms") is first
    assert found.row("rms", "y") is second
    with pytest.raises(UnknownNameError) as caught:
        found.row("rsm")
    assert caught.value.alternatives == ("rms",)


def test_prediction_is_shown_with_a_decimal_more_than_the_publication() -> None:
    row = Comparison(quantity="q", published=22.3607, predicted=22.360680)
    assert numbers(row) == ("22.3607", "22.36068", "", "-2e-05")
    assert numbers(Comparison(quantity="q", published=1.0, predicted=1.0 + 1e-15))[3] == "0"


def test_table_shows_marks_notes_and_ours_where_there_is_one() -> None:
    row = Comparison(
        quantity="error", unit="mm", published=0.5, predicted=0.51, ours=0.04, within=percent(15),
        lowest=0.4, highest=0.6, group="coarse", note="by hand",
    )  # fmt: skip
    shown = str(outcome(row, notes=("mind this",)))
    for part in ("coarse", "error (by hand)", "0.4 … 0.6", "ours", "15 %", "✓", "mind this"):
        assert part in shown
    assert "ours" not in str(outcome(Comparison(quantity="error", published=0.5, predicted=0.9)))


def test_page_escapes_what_others_wrote_and_asks_nobody() -> None:
    evil = "<script>alert(1)</script>"
    figure = Figure(evil, evil, [{"type": "scatter", "x": [0.0], "y": [1.0], "name": evil}])
    page = experiments_page([outcome(Comparison(quantity=evil, note=evil), figures=(figure,))])
    assert evil not in page
    assert "src=" not in page.split("<body", 1)[0]
    assert "default-src 'none'" in page


def test_experiment_that_returns_something_else_is_named() -> None:
    from teleop_core.base.errors import PartError
    from teleop_lab.experiments import Bench

    wrong = Experiment("mine", "mine", "me", lambda bench: None)  # type: ignore[arg-type, return-value]
    with pytest.raises(PartError, match="mine"):
        wrong.run(Bench())
