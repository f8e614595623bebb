"""Drivers: of all open pages one drives, and who stands still while holding loses control."""

from hypothesis import given
from hypothesis import strategies as st

from teleop_console.drivers import PATIENCE, Drivers

STEPS = st.lists(
    st.tuples(
        st.sampled_from(("join", "leave", "take", "hold", "let_go", "heard", "expire", "wait")), st.integers(0, 3)
    ),
    max_size=60,
)


class Clock:
    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        return self.now


def pages(count: int, clock: Clock | None = None) -> Drivers:
    """Drivers with pages 0 to count - 1."""
    drivers = Drivers(clock=clock or Clock())
    for page in range(count):
        drivers.join(page)
    return drivers


@given(STEPS)
def test_never_does_more_than_one_page_drive_nor_one_that_is_closed(steps: list[tuple[str, int]]) -> None:
    clock = Clock()
    drivers = Drivers(clock=clock)
    for word, page in steps:
        if word == "wait":
            clock.now += 2.0
        elif word == "expire":
            drivers.expire()
        else:
            getattr(drivers, word)(page)
        driving = [page for page in range(4) if drivers.may_drive(page)]
        assert driving == ([] if drivers.driver is None else [drivers.driver])
        assert set(driving) <= set(drivers.pages)


def test_first_page_drives_and_the_second_watches_until_it_takes_control() -> None:
    drivers = pages(2)
    assert [drivers.role(page) for page in (0, 1)] == ["you have control", "you watch"]
    drivers.take(1)
    assert [drivers.role(page) for page in (0, 1)] == ["you watch", "you have control"]


def test_nobody_gets_control_unasked_when_the_driver_leaves_but_a_page_that_is_loaded_anew() -> None:
    drivers = pages(2)
    drivers.leave(0)
    assert drivers.driver is None
    assert drivers.role(1) == "you watch, nobody has control"
    drivers.join(2)
    assert drivers.driver == 2


def test_page_that_holds_the_stylus_in_silence_loses_control_after_its_patience() -> None:
    clock = Clock()
    drivers = pages(2, clock)
    assert drivers.hold(0)
    clock.now = PATIENCE
    drivers.expire()
    assert drivers.driver == 0
    clock.now = PATIENCE + 0.01
    drivers.expire()
    assert drivers.driver is None
    drivers.heard(0)  # it comes back, and watches
    assert drivers.driver is None


def test_page_that_gives_signs_of_life_may_hold_still_for_ever() -> None:
    clock = Clock()
    drivers = pages(1, clock)
    drivers.hold(0)
    for clock.now in range(1, 600, 4):
        drivers.heard(0)
        drivers.expire()
    assert drivers.driver == 0


def test_silence_with_an_idle_stylus_costs_nothing() -> None:
    clock = Clock()
    drivers = pages(1, clock)
    drivers.hold(0)
    drivers.let_go(0)
    clock.now = 1e6
    drivers.expire()
    assert drivers.driver == 0


def test_page_that_watches_can_neither_hold_nor_let_go() -> None:
    clock = Clock()
    drivers = pages(2, clock)
    drivers.hold(0)
    assert not drivers.hold(1)
    drivers.let_go(1)
    clock.now = 2 * PATIENCE
    drivers.expire()
    assert drivers.driver is None  # the driver did hold


def test_who_takes_control_holds_nothing_yet() -> None:
    clock = Clock()
    drivers = pages(2, clock)
    drivers.hold(0)
    drivers.take(1)
    clock.now = 2 * PATIENCE
    drivers.expire()
    assert drivers.driver == 1


def test_every_page_drives_where_nothing_can_be_harmed() -> None:
    drivers = pages(3)
    drivers.is_for_all = True
    assert all(drivers.may_drive(page) for page in drivers.pages)
