"""``teleop console``: a page in the browser that shows and drives a session, and replays recordings."""

import time
import webbrowser
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from ipaddress import ip_address
from pathlib import Path
from typing import TYPE_CHECKING

from teleop_console.folders import BAGS
from teleop_core.base.errors import ParameterError, TeleopError
from teleop_core.base.texts import printable
from teleop_core.commands.options import Domain, Nodes, SessionOptions, ros_module

if TYPE_CHECKING:
    from teleop_console.server import ConsoleServer
    from teleop_core.session.configuration import Configuration


def console(
    bag: Path | None = None,
    /,
    *,
    attach: bool = False,
    domain: Domain = None,
    port: int = 8080,
    host: str = "127.0.0.1",
    token: str = "",
    qr: bool = False,
    no_browser: bool = False,
    scenario: str | None = None,
    out: Path | None = None,
    without: Nodes = (),
    settings: SessionOptions = SessionOptions(),
) -> None:
    """See a session in the browser, drive it, replay a recording.

    Opens the page, on which a session is chosen; drag the stylus and the arm follows:

        teleop console
        teleop console --set operator=remote  # starts one at once
        teleop console --scenario fine_box --set slave_sim.plant=hardware
        teleop console --set operator=human   # watch a simulated hand
        teleop console --attach               # a session that runs already
        teleop console bags/run_1             # replay a recording

    The page is served to this machine alone, to those who know the address that is printed. With --host others reach
    it. One browser drives at a time; anybody who has the address may press the emergency stop.

        teleop console --host 0.0.0.0 --qr           # a phone opens the page from the code

    Args:
        bag: Recording to replay.
        attach: Show a session that is running already.
        domain: ROS domain of the session, for --attach.
        port: Port of the page.
        host: Network address of the page; by default it is reachable from this machine only.
        token: Secret in the page's address, without which nothing is answered; by default a new one.
        qr: Show the page's address as a QR code for a phone; needs --host with an address that the phone can reach.
        no_browser: Open no browser.
        scenario: Scenario, one of `teleop scenarios`; a person moves the hand.
        out: Directory of the recording; without it, a new one in bags.
        without: Do not start this node, because another node replaces it on the same ROS_DOMAIN_ID, as arm_bridge
            replaces slave_sim; may be repeated.
        settings: Values of parameters.
    """
    if qr and is_loopback(host):
        raise ParameterError("--qr", qr, "given with --host, such as --host 0.0.0.0: no phone reaches this address")
    if bag is not None and attach:
        raise ParameterError("BAG", str(bag), "left out with --attach, which shows a running session")
    from teleop_console.answers import Situation
    from teleop_console.app import replay
    from teleop_console.server import ConsoleServer
    from teleop_core.bags.finding import check_new

    check_new(out)
    told = Launch(scenario, out, without, settings)
    with ConsoleServer(port, host, token) as server:
        is_told = attach or bag is not None or told != Launch()
        server.answers.situation = Situation(doing="starting …" if is_told else "")
        print(f"console at {server.url}; Ctrl-C ends it", flush=True)
        if qr:
            show_code(server.url_elsewhere)
        if not no_browser and not webbrowser.open(server.url):
            print("there is no browser here: open this address in one", flush=True)
        with suppress(KeyboardInterrupt):
            if attach:
                _attach(domain, server)
                return
            if bag is not None:
                replay(server, bag)
            elif told != Launch() and not _drive(told, server):
                return
            _choose(server)


def is_loopback(host: str) -> bool:
    """Whether only this machine can reach an address."""
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def show_code(url: str) -> None:
    """Print an address and its QR code for a terminal."""
    import segno

    print(f"for a phone: {url}")
    segno.make(url).terminal(compact=True)


@dataclass(frozen=True)
class Launch:
    """Session to start."""

    scenario: str | None = None
    out: Path | None = None
    without: tuple[str, ...] = ()
    settings: SessionOptions = field(default_factory=SessionOptions)

    def configured(self, texts: list[str]) -> "Configuration":
        """Configuration of the session with ``texts`` in place of those of its settings."""
        from teleop_core.session import api

        return api.configuration(self.scenario, files=self.settings.config, texts=texts)


def _choose(server: "ConsoleServer") -> None:
    """Show the start page, and each session or recording that is chosen there, until Ctrl-C."""
    from teleop_console.app import choose, replay
    from teleop_console.choices import texts

    start = server.answers.start
    while True:
        wish = choose(server)
        try:
            if wish.recording is not None:
                replay(server, wish.recording)
            else:
                _drive(
                    Launch(wish.chosen.get("scenario"), settings=SessionOptions(set_=tuple(texts(wish.chosen)))), server
                )
        except TeleopError as error:
            start.told = f"It ended: {error}"
            print(printable(start.told), flush=True)


def _attach(asked: int | None, server: "ConsoleServer") -> None:
    from teleop_console.app import Console, splash

    ros_module("guest")
    from teleop_console.console_link import LiveLink
    from teleop_core.middleware.domains import domain_of_environment
    from teleop_core.nodes.children import environment
    from teleop_core.nodes.guest import Guest
    from teleop_core.nodes.operation import StopButton
    from teleop_core.nodes.sessions import domains

    environment()
    named = domain_of_environment() if asked is None else asked
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


def _drive(launch: Launch, server: "ConsoleServer") -> bool:
    """Show sessions on the page, one after the other; returns whether the page ended the last session."""
    from teleop_console.choices import OWN

    ros_module("guest")
    from teleop_console.console_session import show_session

    first = launch.out or BAGS / time.strftime("console_%Y%m%d_%H%M%S")
    texts, number, wanted = [*OWN, *launch.settings.texts], 0, list[str]()
    start = server.answers.start

    def renew(more: tuple[str, ...]) -> str:
        try:
            launch.configured([*texts, *more])
        except TeleopError as error:
            return str(error)
        wanted.extend(more)
        return ""

    while True:
        out = first if not number else first.with_name(f"{first.name}_session{number + 1}")
        wanted.clear()
        configuration = launch.configured(texts)
        show_session(
            server, configuration, out, lambda _: bool(wanted or start.is_ended), renew=renew, without=launch.without
        )
        print(f"{out}: recorded; next: teleop evaluate {out}", flush=True)
        if not wanted:
            return start.is_ended
        texts, number = [*texts, *wanted], number + 1
