"""``teleop console``: a page in the browser that shows and drives a session, and replays recordings."""

import argparse
import time
import webbrowser
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from teleop_console.folders import BAGS
from teleop_core.base.errors import ParameterError, TeleopError
from teleop_core.base.texts import printable
from teleop_core.commands.arguments import command, domain_argument, ros_module, setting_arguments, without_argument

if TYPE_CHECKING:
    from teleop_console.server import ConsoleServer

_EPILOG = """\
opens the page, on which a session is chosen; drag the stylus and the arm follows:
  teleop console
  teleop console --set operator=remote         starts one at once
  teleop console --scenario fine_box --set slave_sim.plant=hardware
  teleop console --set operator=human          watch a simulated hand
  teleop console --attach                      a session that runs already
  teleop console bags/run_1                    replay a recording
The page is served to this machine alone. With --host others reach it, who need the token that is
printed with the address. One browser drives at a time; anybody may press the emergency stop.
"""


def add(commands: Any) -> None:
    """Add the command's parser."""
    text = "see a session in the browser, drive it, replay a recording"
    parser = command(commands, "console", _run, text, _EPILOG)
    parser.add_argument("bag", type=Path, nargs="?", help="recording to replay")
    parser.add_argument("--attach", action="store_true", help="show a session that is running already")
    domain_argument(parser, "ROS domain of the session, for --attach")
    parser.add_argument("--port", type=int, default=8080, help="port of the page (default: 8080)")
    parser.add_argument(
        "--host", default="127.0.0.1", help="network address of the page (default: reachable from this machine only)"
    )
    parser.add_argument(
        "--token", default="", help="secret that opens the page (default: a new one with --host, else none)"
    )
    parser.add_argument("--no-browser", action="store_true", help="open no browser")
    parser.add_argument("--scenario", help="scenario, one of `teleop scenarios`; a person moves the hand")
    parser.add_argument("--out", type=Path, help="directory of the recording (default: bags/…)")
    without_argument(parser)
    setting_arguments(parser)


def _run(arguments: argparse.Namespace) -> int:
    if arguments.bag is not None and arguments.attach:
        raise ParameterError("BAG", str(arguments.bag), "left out with --attach, which shows a running session")
    from teleop_console.answers import Situation
    from teleop_console.server import ConsoleServer
    from teleop_core.bags.finding import check_new

    check_new(arguments.out)
    with ConsoleServer(arguments.port, arguments.host, arguments.token) as server:
        is_told = arguments.attach or arguments.bag is not None or _is_told(arguments)
        server.answers.situation = Situation(doing="starting …" if is_told else "")
        print(f"console at {server.url}; Ctrl-C ends it", flush=True)
        if not arguments.no_browser and not webbrowser.open(server.url):
            print("there is no browser here: open this address in one", flush=True)
        try:
            return _show(arguments, server)
        except KeyboardInterrupt:
            return 0


def _show(arguments: argparse.Namespace, server: "ConsoleServer") -> int:
    if arguments.attach:
        _attach(arguments, server)
        return 0
    from teleop_console.app import choose, replay
    from teleop_console.choices import texts

    if arguments.bag is not None:
        replay(server, arguments.bag)
    elif _is_told(arguments) and not _drive(arguments, server, arguments.settings):
        return 0
    start = server.answers.start
    while True:
        wish = choose(server)
        try:
            if wish.recording is not None:
                replay(server, wish.recording)
            else:
                arguments.scenario = wish.chosen.get("scenario")
                arguments.out, arguments.config, arguments.without = None, [], []
                _drive(arguments, server, texts(wish.chosen))
        except TeleopError as error:
            start.told = f"It ended: {error}"
            print(printable(start.told), flush=True)


def _is_told(arguments: argparse.Namespace) -> bool:
    """Whether the command line defines the session to start."""
    given = (arguments.scenario, arguments.settings, arguments.config, arguments.out)
    return any(given) or bool(arguments.without)


def _attach(arguments: argparse.Namespace, server: "ConsoleServer") -> None:
    from teleop_console.app import Console, splash

    ros_module("guest")
    from teleop_console.console_link import LiveLink
    from teleop_core.middleware.domains import domain_of_environment
    from teleop_core.nodes.children import environment
    from teleop_core.nodes.guest import Guest
    from teleop_core.nodes.operation import StopButton
    from teleop_core.nodes.sessions import domains

    environment()
    named = domain_of_environment() if arguments.domain is None else arguments.domain
    found = domains() if named is None else (named,)
    if len(found) > 1:
        running = ", ".join(map(str, found))
        raise ParameterError("--domain", None, f"one of {running}: several sessions run here")
    domain = found[0] if found else 0
    with Guest("teleop_console_stop", domain, start_parameter_services=False) as guest:
        button = StopButton(guest)
        server.answers.stop = partial(button.say, is_pressed=True)
        with splash(server) as say:
            say("looks for an arm …")
            link = LiveLink(domain, button=button)
        with link:
            Console(server, link).run(lambda: False)


def _drive(arguments: argparse.Namespace, server: "ConsoleServer", settings: Sequence[str]) -> bool:
    """Show sessions on the page, one after the other; returns whether the page ended the last session."""
    from teleop_console.choices import OWN

    ros_module("guest")
    from teleop_console.console_session import show_session

    first = arguments.out or BAGS / time.strftime("console_%Y%m%d_%H%M%S")
    texts, number, wanted = [*OWN, *settings], 0, list[str]()
    start = server.answers.start

    def renew(more: tuple[str, ...]) -> str:
        try:
            _configured(arguments, [*texts, *more])
        except TeleopError as error:
            return str(error)
        wanted.extend(more)
        return ""

    while True:
        out = first if not number else first.with_name(f"{first.name}_session{number + 1}")
        wanted.clear()
        configuration = _configured(arguments, texts)
        show_session(
            server, configuration, out, lambda _: bool(wanted or start.is_ended), renew=renew, without=arguments.without
        )
        print(f"{out}: recorded; next: teleop evaluate {out}", flush=True)
        if not wanted:
            return start.is_ended
        texts, number = [*texts, *wanted], number + 1


def _configured(arguments: argparse.Namespace, texts: list[str]) -> Any:
    from teleop_core.session import api

    return api.configuration(arguments.scenario, files=arguments.config, texts=texts)
