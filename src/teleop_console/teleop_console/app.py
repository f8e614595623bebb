"""Console: the page of one session, from the begin of the session to its end."""

import gc
import logging
import os
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path

from teleop_console.answers import Situation
from teleop_console.camera_pictures import CameraPictures
from teleop_console.front import STOPPER
from teleop_console.link import Parameters, SessionLink
from teleop_console.panel import Panel
from teleop_console.recorded import RecordedLink
from teleop_console.scene import Scene
from teleop_console.server import ConsoleServer
from teleop_console.settings import Renew
from teleop_console.start import Wish
from teleop_console.status import closes, display_text, situation
from teleop_console.stylus import Steps, Stylus
from teleop_console.timeline import Timeline
from teleop_console.view_tab import Insets, ViewTab, Visitors, theme

RATE = 30.0
"""Rate at which the page is drawn [1/s]."""
_NICE = 10
_ASK_AGAIN = 2.0  # [s]


class Console:
    """A page that shows a session and drives it.

    Args:
        server: Server of the page.
        link: The session.
        renew: Function that begins a new session with other settings. It returns the reason of a refusal, else an empty
            text. None if the console did not start the session.
        of_session: Parameters of the whole session, which belong to no node.
        can_end: Whether the page can end the shown session or replay.
        if_stopped: Text that pages without a panel show during an emergency stop. If it is empty, they show the
            operator's next step.
    """

    def __init__(
        self,
        server: ConsoleServer,
        link: SessionLink,
        renew: Renew | None = None,
        of_session: Parameters | None = None,
        *,
        can_end: bool = False,
        if_stopped: str = "",
    ) -> None:
        self._if_stopped = if_stopped
        self._server, self._link, drivers = server, link, server.drivers
        self._can_end = can_end
        theme(server.viser, is_dark=False)
        self.scene = Scene(server.viser, link.arms)
        self.stylus = Stylus(
            server.viser, self.scene, on_hold=link.hold, on_let_go=self._let_go, may_drive=drivers.hold
        )
        drivers.is_for_all = not link.is_live
        self._failed = set[str]()
        self.panel = Panel(server.viser, link, drivers, renew, of_session)
        if if_stopped:
            server.viser.gui.main_panel.float()  # hidden by the page's style: the scene fills the whole window
        self.panel.settings.on_change(self.scene.retune)
        self.timeline = server.answers.strip.shown = Timeline(link)
        self._visitors = Visitors(server.viser, drivers, self.scene, is_live=link.is_live)
        if link.is_live:
            server.answers.stop, server.answers.jaw = self._stop, link.close_jaw
        else:
            server.answers.situation = Situation(can_stop=False, can_end=can_end)
        if link.is_live:
            with self.panel.stylus_folder:
                arms = tuple(arm.name for arm in link.arms)
                Steps(server.viser, self.stylus, arms, drivers.may_drive)
        with self.panel.view_tab:
            ViewTab(server.viser, self.scene, self._visitors)
            self._pictures = CameraPictures(server.viser, self.scene)
            self._insets = Insets(server.viser, self.scene)

    def _stop(self) -> None:
        self._link.press(is_pressed=True)

    def _let_go(self, arm: str) -> None:
        drivers = self._server.drivers
        if drivers.driver is not None:
            drivers.let_go(drivers.driver)
        self._link.let_go(arm)

    def draw(self) -> None:
        """Show the newest data of the session."""
        view = seen = self._link.view()
        if self._link.is_live:
            can_press = self.panel.is_led_here and any(map(closes, view.arms.values()))
            told = replace(situation(view), can_end=self._can_end, can_press=can_press)
            told = replace(told, text=told.text and (self._if_stopped or told.text))
            self._server.answers.situation = told
            seen = self.timeline.shown(view, is_stopped=told.is_stopped)
            is_now = seen is view and not told.is_stopped
            self.stylus.show(is_shown=is_now and self.panel.is_led_here)
        self.scene.draw(seen)
        self.stylus.draw(view)
        self.panel.draw(view)
        self.panel.settings.follow(self._link.changes())
        self._insets.say(display_text(view))
        self._pictures.draw(view.pictures)
        self._visitors.look()

    def _ask(self, is_over: Callable[[], bool]) -> None:
        """Ask the nodes for their parameters until all nodes are up and have answered."""
        while not is_over() and not self.panel.settings.refresh():
            time.sleep(_ASK_AGAIN)

    def try_to_draw(self) -> None:
        """Draw. An error is reported once; it cancels this drawing, but does not end the session."""
        try:
            self.draw()
        except Exception as error:
            if (kind := repr(error)) not in self._failed:
                self._failed.add(kind)
                logging.getLogger("teleop_console").exception("the page could not be drawn")

    def run(self, is_over: Callable[[], bool]) -> None:
        """Draw until `is_over` returns true; missed drawings are not repeated."""
        if self._link.is_live:
            give_way()
        threading.Thread(target=self._ask, args=(is_over,), daemon=True).start()
        thresholds = gc.get_threshold()
        # A garbage collection delays a stop. A collection of all objects of the page takes 0.2 s. So only new objects
        # are collected, and so often that each collection is short.
        gc.freeze()
        gc.set_threshold(*thresholds[:2], 1)
        try:
            due = time.monotonic()
            while not is_over():
                self.try_to_draw()
                due = max(due + 1.0 / RATE, time.monotonic())
                time.sleep(max(0.0, due - time.monotonic()))
        finally:
            gc.set_threshold(*thresholds)
            gc.unfreeze()
        self.close()

    def close(self) -> None:
        """Remove this session from the page, so that the page can show another one."""
        answers = self._server.answers
        answers.stop, answers.jaw, answers.situation = None, None, Situation(doing="closing …")
        answers.strip.shown = None
        self._server.drivers.is_for_all = False
        self._visitors.close()


def give_way() -> None:
    """Lower the priority of the page below that of the session, because arm and stop must never be late."""
    stop = {thread.native_id for thread in threading.enumerate() if thread.name == STOPPER}
    with suppress(OSError):  # only on Linux does each thread have its own priority
        for thread in {int(name) for name in os.listdir("/proc/self/task")} - stop:
            os.setpriority(os.PRIO_PROCESS, thread, _NICE)


def choose(server: ConsoleServer) -> Wish:
    """Show the form on which a session is chosen, until a person at the page chooses one."""
    answers = server.answers
    _empty(server)
    answers.situation = Situation(chooses=True)
    try:
        return answers.start.wait()
    finally:
        answers.situation = Situation(doing="starting …")


def _empty(server: ConsoleServer) -> None:
    """Remove everything that the page shows."""
    server.viser.gui.reset()
    server.viser.scene.reset()


@contextmanager
def splash(server: ConsoleServer) -> Iterator[Callable[[str], None]]:
    """Show the progress on an empty page until the session can be shown."""
    _empty(server)
    answers = server.answers

    is_over = threading.Event()

    def say(line: str) -> None:
        if not is_over.is_set():
            answers.situation = Situation(doing=line)

    answers.situation = Situation(doing="starting …")
    try:
        yield say
    finally:
        is_over.set()
        answers.situation = Situation()


def replay(server: ConsoleServer, path: Path) -> None:
    """Show a recording until the page ends the replay, or until Ctrl-C.

    Raises:
        RecordingError: The recording cannot be read, or comes from another system.
    """
    link = RecordedLink(path)
    _empty(server)
    console = Console(server, link, can_end=True)
    console.panel.settings.refresh()
    console.scene.remember(link.path)
    console.stylus.show(is_shown=False)
    before = time.monotonic()
    while not server.answers.start.is_ended:
        now = time.monotonic()
        link.advance(now - before)
        before = now
        console.try_to_draw()
        time.sleep(max(0.0, now + 1.0 / RATE - time.monotonic()))
    console.close()
