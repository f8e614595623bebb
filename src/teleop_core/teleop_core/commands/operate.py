"""``teleop stop`` and ``teleop operate``: stop arms, command their states, show their states."""

import argparse
from typing import TYPE_CHECKING, Any

from teleop_core.base.errors import SessionError
from teleop_core.commands.arguments import command, domain_argument, ros_module
from teleop_core.graph.topics import STATE_COMMANDS
from teleop_core.middleware.domains import domain_of_environment

if TYPE_CHECKING:
    from teleop_core.nodes.remote_control import ArmState, RemoteControl

_STOP = """\
stops all arms of all `teleop live` sessions of this machine, or of one ROS domain:
  teleop stop
  teleop stop --domain 42
the stop is latched. To go on: release it, reset and enable each arm:
  teleop operate release reset enable
release overrides every stop button that is pressed, and names it
"""
_OPERATE = """\
without commands it says how the arms are; commands are sent one after the other:
  teleop operate
  teleop operate enable home                 an arm that waits for people
  teleop operate release reset enable        after an emergency stop
  teleop operate pause --arm left            one arm of several
commands: release, """ + ", ".join(STATE_COMMANDS)


def add(commands: Any) -> None:
    """Add the parsers of ``teleop stop`` and ``teleop operate``."""
    text = "emergency stop of the arms that run here"
    stop = command(commands, "stop", _stop, text, _STOP)
    text = "enable, home, pause or reset arms, or show their states"
    operate = command(commands, "operate", _operate, text, _OPERATE)
    operate.add_argument("words", nargs="*", metavar="COMMAND", help="see below")
    operate.add_argument("--arm", help="namespace of one arm (default: all)")
    for parser in (stop, operate):
        domain_argument(parser, "ROS domain (default: ROS_DOMAIN_ID, or those of all sessions of this machine)")


def chosen_domains(arguments: argparse.Namespace) -> tuple[int, ...]:
    """ROS domains that the command applies to.

    Raises:
        SessionError: No domain is named, and no session runs on this machine.
    """
    if arguments.domain is not None:
        return (arguments.domain,)
    if (named := domain_of_environment()) is not None:
        return (named,)
    from teleop_core.nodes.sessions import domains

    found = domains()
    if not found:
        raise SessionError(
            "no `teleop live` runs on this machine; give the ROS domain of a session elsewhere: --domain N"
        )
    return found


def _operators(arguments: argparse.Namespace) -> "list[RemoteControl]":
    from teleop_core.nodes.children import environment

    module = ros_module("remote_control")
    environment()
    return [module.RemoteControl(domain) for domain in chosen_domains(arguments)]


def _stop(arguments: argparse.Namespace) -> int:
    failed = False
    for one in _operators(arguments):
        with one as operator:
            try:
                arms = operator.stop()
            except SessionError as error:
                print(error)
                failed = True
                continue
            for name, arm in arms.items():
                print(f"{name or 'arm'}: {_stopped(arm)}")
    return 1 if failed else 0


def _stopped(arm: "ArmState") -> str:
    values = arm.values
    return (
        f"stopped, confirmed after {1000.0 * arm.stopped_after:.0f} ms; at rest "
        f"{1000.0 * values['rest_time']:.0f} ms after the stop message; stopping distance "
        f"{1000.0 * values['travel']:.2f} mm"
    )


def _operate(arguments: argparse.Namespace) -> int:
    code = 0
    for one in _operators(arguments):
        with one as operator:
            names = [arguments.arm] if arguments.arm is not None else list(operator.look())
            for word in arguments.words:
                for name in names:
                    is_done, text = operator.command(word, name)
                    print(f"{name or 'arm'}: {text}")
                    code = code or (0 if is_done else 1)
            if not arguments.words:
                for name, arm in operator.arms.items():
                    print(f"{name or 'arm'} on ROS domain {operator.domain}: {arm.text}")
    return code
