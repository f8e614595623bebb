"""``teleop console``: a page in the browser that shows a session, drives it, replays recordings."""

import argparse
import time
import webbrowser
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from teleop_core.base.errors import ParameterError, TeleopError
from teleop_core.base.texts import printable
from teleop_core.commands.arguments import command, ros_module, setting_arguments, without_argument

if TYPE_CHECKING:
    from teleop_console.server import ConsoleServer

_EPILOG = """\
starts a session and opens the page; drag the stylus with the mouse and the arm follows:
  teleop console
  teleop console --scenario fine_box --set slave_sim.plant=hardware
  teleop console --set operator=human          watch a simulated hand
  teleop console --attach                      a session that runs already
  teleop console bags/run_1                    replay a recording
The page is served to this machine alone. With --host others reach it, who need the token that is
printed with the address. One browser drives at a time; anybody may press the emergency stop.
"""
_OWN = ("operator=remote", "teleop.duration=86400.0")
"""What a session behind a page is beside its scenario: a person is the hand, until Ctrl-C."""


def add(commands: Any) -> None:
    """Add the command's parser."""
    text = "see a session in the browser, drive it, replay a recording"
    parser = command(commands, "console", _run, text, _EPILOG)
    parser.add_argument("bag", type=Path, nargs="?", help="recording to replay")
    parser.add_argument("--attach", action="store_true", help="show a session that runs already")
    parser.add_argument("--domain", type=int, metavar="N", help="its ROS domain, for --attach")
    parser.add_argument("--port", type=int, default=8080, help="port of the page (default: 8080)")
    parser.add_argument(
        "--host", default="127.0.0.1", help="address to serve at (default: this machine alone)"
    )
    parser.add_argument("--token", default="", help="secret of the page (default: made for --host)")
    parser.add_argument("--no-browser", action="store_true", help="open no browser")
    parser.add_argument("--scenario", help="one of `teleop scenarios`, with a person as its hand")
    parser.add_argument("--out", type=Path, help="directory of the recording (default: bags/…)")
    without_argument(parser)
    setting_arguments(parser)


def _run(arguments: argparse.Namespace) -> int:
    if arguments.bag is not None and arguments.attach:
        raise ParameterError("BAG", str(arguments.bag), "a recording, or --attach, not both")
    from teleop_console.answers import Situation
    from teleop_console.server import ConsoleServer

    with ConsoleServer(arguments.port, arguments.host, arguments.token) as server:
        server.answers.situation = Situation(doing="starting …")
        print(f"console at {server.url}; Ctrl-C ends it", flush=True)
        if not arguments.no_browser and not webbrowser.open(server.url):
            print("there is no browser here: open this address in one", flush=True)
        try:
            return _show(arguments, server)
        except KeyboardInterrupt:
            return 0


def _show(arguments: argparse.Namespace, server: "ConsoleServer") -> int:
    if arguments.bag is not None:
        from teleop_console.app import replay

        replay(server, arguments.bag)
    elif arguments.attach:
        _attach(arguments, server)
    else:
        _drive(arguments, server)
    return 0


def _attach(arguments: argparse.Namespace, server: "ConsoleServer") -> None:
    from teleop_console.app import Console, splash

    ros_module("guest")
    from teleop_console.console_link import LiveLink
    from teleop_core.nodes.children import environment
    from teleop_core.nodes.guest import Guest
    from teleop_core.nodes.operation import StopButton
    from teleop_core.nodes.sessions import domains

    environment()
    found = (arguments.domain,) if arguments.domain is not None else domains()
    if len(found) > 1:
        named = ", ".join(map(str, found))
        raise ParameterError("--domain", None, f"one of {named}: several sessions run here")
    domain = found[0] if found else 0
    with Guest("teleop_console_stop", domain, start_parameter_services=False) as guest:
        button = StopButton(guest)
        server.answers.stop = partial(button.say, is_pressed=True)
        with splash(server) as say:
            say("looks for an arm …")
            link = LiveLink(domain, button=button)
        with link:
            Console(server, link).run(lambda: False)


def _drive(arguments: argparse.Namespace, server: "ConsoleServer") -> None:
    """Start sessions one after the other, each with the page, until Ctrl-C."""
    from teleop_console.app import Console, splash
    from teleop_console.recorded_arms import parameters_of
    from teleop_core.graph.layers import SESSION

    ros_module("guest")
    from teleop_console.console_session import ConsoleSession

    first = arguments.out or Path("bags") / time.strftime("console_%Y%m%d_%H%M%S")
    texts, number, wanted = [*_OWN, *arguments.settings], 0, list[str]()

    def renew(more: tuple[str, ...]) -> str:
        try:
            _configured(arguments, [*texts, *more])
        except TeleopError as error:
            return str(error)
        wanted.extend(more)
        return ""

    while True:
        out = first if not number else first.with_name(f"{first.name}_session{number + 1}")
        with splash(server) as say:
            configuration = _configured(arguments, texts)
            session = ConsoleSession(configuration, out, _both(say), arguments.without)
            server.answers.stop = partial(session.button.say, is_pressed=True)
            try:
                link = session.link()
            except BaseException:
                session.end()
                raise
        wanted.clear()
        with session, link:
            of_session = parameters_of(configuration, (SESSION,))
            console = Console(server, link, renew, of_session)
            console.run(lambda session=session: session.is_over or bool(wanted))  # type: ignore[misc]
        session.check()
        print(f"{out}: recorded; next: teleop evaluate {out}", flush=True)
        if not wanted:
            return
        texts, number = [*texts, *wanted], number + 1


def _configured(arguments: argparse.Namespace, texts: list[str]) -> Any:
    from teleop_core.session import api

    return api.configuration(arguments.scenario, files=arguments.config, texts=texts)


def _both(say: Callable[[str], None]) -> Callable[[str], None]:
    """Say on the page what matters while a session starts, and in the terminal."""

    def tell(line: str) -> None:
        if "s  " not in line:  # its line of every second is on the page
            print(printable(line), flush=True)
            say(line)

    return tell
