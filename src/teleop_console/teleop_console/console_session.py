"""Console session: a live session that the page starts and ends."""

import threading
from collections.abc import Callable, Collection
from functools import partial
from pathlib import Path

from rich.console import Console

from teleop_console.app import Console as AppPage
from teleop_console.app import splash
from teleop_console.console_link import LiveLink
from teleop_console.link import View
from teleop_console.recorded_arms import parameters_of
from teleop_console.server import ConsoleServer
from teleop_console.settings import Renew
from teleop_core.base.errors import SessionError, TeleopError
from teleop_core.base.texts import printable
from teleop_core.graph.layers import SESSION
from teleop_core.nodes.children import environment
from teleop_core.nodes.crews import Processes
from teleop_core.nodes.guest import Guest
from teleop_core.nodes.interrupt import Interrupt
from teleop_core.nodes.live import live
from teleop_core.nodes.operation import StopButton
from teleop_core.session.configuration import Configuration

_LOOK = 1.0  # time between two checks whether the session has ended, while the arm is not found [s]
_END_PATIENCE = 60.0


class _Lines:
    """Text file that passes each line to a function as soon as the line is complete."""

    def __init__(self, say: Callable[[str], None]) -> None:
        self._say, self._rest = say, ""

    def write(self, text: str) -> int:
        """Accept text, and pass all complete lines to the function."""
        *lines, self._rest = (self._rest + text).split("\n")
        for line in lines:
            if line:
                self._say(line)
        return len(text)

    def flush(self) -> None:
        """Do nothing, because no text is buffered."""


class ConsoleSession:
    """A session in its own ROS domain, used as a context manager. If no node is replaced, all nodes run in one process.

    If ``ROS_DOMAIN_ID`` is set, the session uses that domain, and this process cannot run a second session. The
    processes of the session end when this process ends, even if this process is killed.

    Args:
        configuration: Configuration of the session.
        out: Directory of the recording.
        say: Called with each line of the session's output, in a separate thread.
        without: Nodes that are not started, because other programs replace them.

    Attributes:
        domain: ROS domain of the session.
        button: Stop button of the session; it works before the arm is found.
    """

    def __init__(
        self, configuration: Configuration, out: Path, say: Callable[[str], None], without: Collection[str] = ()
    ) -> None:
        self.domain = int(environment()["ROS_DOMAIN_ID"])
        self._configuration, self._out, self._without = configuration, out, without
        self._console = Console(file=_Lines(say), width=200)  # type: ignore[arg-type]
        self._interrupt, self._error = Interrupt(), ""
        self._guest = Guest("teleop_console_stop", self.domain, start_parameter_services=False)
        self.button = StopButton(self._guest)
        self._thread = threading.Thread(target=self._run, name="session")
        self._thread.start()

    def __enter__(self) -> "ConsoleSession":
        return self

    def __exit__(self, *_: object) -> None:
        self.end()

    def _run(self) -> None:
        try:
            live(
                self._configuration,
                self._out,
                self._console,
                processes=Processes.ONE,
                without=self._without,
                interrupt=self._interrupt,
                domain=self.domain,
            )
        except TeleopError as error:
            if not self._interrupt.has_come:
                self._error = str(error)

    @property
    def is_over(self) -> bool:
        """Whether the session has ended."""
        return not self._thread.is_alive()

    def check(self) -> None:
        """Check that the session runs, or has ended without an error.

        Raises:
            SessionError: The session ended with an error.
        """
        if self._error:
            raise SessionError(self._error)

    def link(self) -> LiveLink:
        """Wait until the arm of the session is found, and return the link to the session.

        Raises:
            SessionError: The session ended before its arm was found.
        """
        while True:
            try:
                title = self._configuration.scenario
                return LiveLink(self.domain, title, patience=_LOOK, button=self.button)
            except SessionError:
                self.check()
                if self.is_over:
                    raise

    def end(self) -> None:
        """End the session, and close its recording."""
        self._interrupt.ask()
        self._thread.join(_END_PATIENCE)
        self._guest.close()


def show_session(
    server: ConsoleServer,
    configuration: Configuration,
    out: Path,
    is_over: Callable[[View], bool],
    *,
    renew: Renew | None = None,
    without: Collection[str] = (),
    if_stopped: str = "",
) -> None:
    """Run a session and show it on the page until the session ends.

    Args:
        server: Server of the page.
        configuration: Configuration of the session.
        out: Directory of the recording.
        is_over: Function that returns whether the session must end; called at every drawing with the present view.
        renew: As in :class:`~teleop_console.app.Console`.
        without: As in :class:`ConsoleSession`.
        if_stopped: As in :class:`~teleop_console.app.Console`. If the text is not empty, pages show only that the
            session starts, and cannot end the session.

    Raises:
        SessionError: The session could not begin, or ended with an error.
    """
    with splash(server) as say:
        session = ConsoleSession(configuration, out, _both(say, is_on_page=not if_stopped), without)
        server.answers.stop = partial(session.button.say, is_pressed=True)
        try:
            link = session.link()
        except BaseException:
            session.end()
            raise
    with session, link:
        of_session = parameters_of(configuration, (SESSION,))
        page = AppPage(server, link, renew, of_session, can_end=not if_stopped, if_stopped=if_stopped)
        page.run(lambda: session.is_over or is_over(link.view()))
    session.check()


def _both(say: Callable[[str], None], *, is_on_page: bool) -> Callable[[str], None]:
    """Print a line in the terminal. While a session starts, the page also shows relevant lines."""

    def tell(line: str) -> None:
        if "s  " not in line:  # the line that the session prints each second is already on the page
            print(printable(line), flush=True)
            if is_on_page:
                say(line)

    return tell
