"""Drivers: one of the open pages drives at a time; the others watch."""

import threading
import time
from collections.abc import Callable

PATIENCE = 5.0
"""Time [s] after which a page that holds the stylus and gives no sign of life loses control."""


class Drivers:
    """Who of the open pages may command the session.

    The first page drives. Others watch until they take control, which always succeeds: two people
    at one arm talk to each other. A page that comes while nobody drives gets control, so that one
    which is loaded again goes on; a page that is already open never gets it without asking. Control
    is lost by leaving, and by silence while the stylus is held: a page that stands still then would
    always hold it. Silence with an idle stylus harms nobody, and browsers slow hidden pages down.

    Methods may be called from any thread.

    Attributes:
        is_for_all: Whether every page drives, as where nothing can be harmed: in a replay.

    Args:
        patience: Time without a sign of life after which a held stylus is lost [s].
        clock: Monotonic time [s].
    """

    def __init__(self, patience: float = PATIENCE, clock: Callable[[], float] = time.monotonic) -> None:
        self._patience, self._clock = patience, clock
        self._lock = threading.RLock()
        self._heard: dict[int, float] = {}
        self._driver: int | None = None
        self._holds, self.is_for_all = False, False

    @property
    def driver(self) -> int | None:
        """The page that drives; None if none does."""
        return self._driver

    @property
    def pages(self) -> tuple[int, ...]:
        """All open pages, in the order in which they came."""
        with self._lock:
            return tuple(self._heard)

    def may_drive(self, page: int) -> bool:
        """Whether commands of a page count."""
        return self.is_for_all or page == self._driver

    def role(self, page: int) -> str:
        """What to tell the people at a page about it."""
        if self.may_drive(page):
            return "you have control"
        return "you watch" if self._driver is not None else "you watch, nobody has control"

    def join(self, page: int) -> None:
        """A page has opened; it drives if nobody does."""
        with self._lock:
            self._heard[page] = self._clock()
            self._give(page if self._driver is None else self._driver)

    def leave(self, page: int) -> None:
        """A page has closed, or its connection is lost."""
        with self._lock:
            self._heard.pop(page, None)
            self._give(None if page == self._driver else self._driver)

    def take(self, page: int) -> None:
        """Give control to a page; nothing happens if it has closed meanwhile."""
        with self._lock:
            if page in self._heard:
                self._heard[page] = self._clock()
                self._give(page)

    def heard(self, page: int) -> None:
        """A page has given a sign of life."""
        with self._lock:
            if page in self._heard:
                self._heard[page] = self._clock()

    def hold(self, page: int) -> bool:
        """A page takes the stylus or moves it; false if it may not."""
        with self._lock:
            self._holds = self._holds or self.may_drive(page)
            return self.may_drive(page)

    def let_go(self, page: int) -> None:
        """A page lets go of the stylus."""
        with self._lock:
            self._holds = self._holds and not self.may_drive(page)

    def expire(self) -> None:
        """Take control from a driver who holds the stylus and has been silent for too long."""
        with self._lock:
            if self._driver is None or not self._holds:
                return
            if self._clock() - self._heard[self._driver] > self._patience:
                self._give(None)

    def _give(self, page: int | None) -> None:
        """Change the driver; whoever drove before holds nothing any more."""
        if page != self._driver:
            self._driver, self._holds = page, False
