"""Drivers: one of the open pages drives at a time; the others watch."""

import threading
import time
from collections.abc import Callable

PATIENCE = 5.0
"""A page that holds the stylus and gives no sign of life for this time [s] loses control."""


class Drivers:
    """Decides which of the open pages may command the session.

    The first page drives. Other pages watch until they take control. Taking control always succeeds, because two people
    at one arm talk to each other. A page that opens while no page drives gets control, so that a reloaded page
    continues to drive. A page that is already open gets control only on request. A page loses control when it closes,
    and when it is silent while it holds the stylus; otherwise a page that hangs would keep the stylus. Silence
    with a free stylus is harmless and usual, because browsers slow hidden pages down.

    Methods may be called from any thread.

    Attributes:
        is_for_all: Whether every page drives; true in a replay, because a replay commands no arm.

    Args:
        patience: Time without a sign of life after which a page loses a held stylus [s].
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
        """Number of the page that drives; None if no page drives."""
        return self._driver

    @property
    def pages(self) -> tuple[int, ...]:
        """All open pages, in the order of their opening."""
        with self._lock:
            return tuple(self._heard)

    def may_drive(self, page: int) -> bool:
        """Whether commands of a page are accepted."""
        return self.is_for_all or page == self._driver

    def role(self, page: int) -> str:
        """Text for the people at a page: whether the page drives."""
        if self.may_drive(page):
            return "you have control"
        return "you watch" if self._driver is not None else "you watch, nobody has control"

    def join(self, page: int) -> None:
        """Add a page that has opened; it drives if no other page drives."""
        with self._lock:
            self._heard[page] = self._clock()
            self._give(page if self._driver is None else self._driver)

    def leave(self, page: int) -> None:
        """Remove a page that has closed, or whose connection is lost."""
        with self._lock:
            self._heard.pop(page, None)
            self._give(None if page == self._driver else self._driver)

    def take(self, page: int) -> None:
        """Give control to a page; nothing happens if the page has closed in the meantime."""
        with self._lock:
            if page in self._heard:
                self._heard[page] = self._clock()
                self._give(page)

    def heard(self, page: int) -> None:
        """Record a sign of life of a page."""
        with self._lock:
            if page in self._heard:
                self._heard[page] = self._clock()

    def hold(self, page: int) -> bool:
        """Record that a page holds or moves the stylus; returns false if the page may not do this."""
        with self._lock:
            self._holds = self._holds or self.may_drive(page)
            return self.may_drive(page)

    def let_go(self, page: int) -> None:
        """Record that a page releases the stylus."""
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
        """Change the driving page; the former page no longer holds the stylus."""
        if page != self._driver:
            self._driver, self._holds = page, False
