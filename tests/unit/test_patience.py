"""Patience of the tests: as said on an idle machine, longer on a busy one, never endless."""

import pytest

from patience import BUSY_SHARE, Patience, stalled, wait_until


class Machine:
    """A clock, and for which part of its time nobody got a processor."""

    def __init__(self) -> None:
        self.now = self.busy = 0.0

    def patience(self, seconds: float) -> Patience:
        return Patience(seconds, lambda: self.now, lambda: self.busy)

    def go_on(self, seconds: float, share: float) -> None:
        self.now += seconds
        self.busy += share * seconds


def lasts(share: float) -> float:
    """How long a patience of ten seconds lasts where this share of the time is busy [s]."""
    machine = Machine()
    patience = machine.patience(10.0)
    while not patience.is_over():
        machine.go_on(0.01, share)
    return machine.now


@pytest.mark.parametrize(("share", "seconds"), [(0.0, 10.0), (0.5, 16.0), (1.0, 10.0 / BUSY_SHARE)])
def test_patience_lasts_longer_by_what_the_machine_was_too_busy_for(
    share: float, seconds: float
) -> None:
    assert lasts(share) == pytest.approx(seconds, abs=0.02)


def test_a_state_that_never_comes_is_named() -> None:
    with pytest.raises(AssertionError, match="a state"):
        wait_until(lambda: False, "a state", timeout=0.0)


def test_the_account_of_the_machine_only_grows() -> None:
    before = stalled()
    assert stalled() >= before >= 0.0
