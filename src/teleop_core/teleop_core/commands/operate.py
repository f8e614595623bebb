"""``teleop stop`` and ``teleop operate``: stop arms, command their states, show their states."""

from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from teleop_core.base.errors import SessionError
from teleop_core.commands.options import Domain, ros_module
from teleop_core.middleware.domains import domain_of_environment

if TYPE_CHECKING:
    from teleop_core.nodes.remote_control import RemoteControl, ReportedArm


def chosen_domains(domain: int | None) -> tuple[int, ...]:
    """ROS domains that the command applies to.

    Raises:
        SessionError: No domain is named, and no session runs on this machine.
    """
    if domain is not None:
        return (domain,)
    if (named := domain_of_environment()) is not None:
        return (named,)
    from teleop_core.nodes.sessions import domains

    found = domains()
    if not found:
        raise SessionError(
            "no `teleop live` runs on this machine; give the ROS domain of a session elsewhere: --domain N"
        )
    return found


def _operators(domain: int | None) -> "list[RemoteControl]":
    from teleop_core.nodes.children import environment

    module = ros_module("remote_control")
    environment()
    return [module.RemoteControl(one) for one in chosen_domains(domain)]


def stop(*, domain: Domain = None) -> int:
    """Emergency stop of the arms that run here.

    Stops all arms of all `teleop live` sessions of this machine, or of one ROS domain:

        teleop stop
        teleop stop --domain 42

    The stop is latched. To go on, release it, reset and enable each arm:

        teleop operate release reset enable

    Release overrides every stop button that is pressed, and names it.

    Args:
        domain: ROS domain; without it, ROS_DOMAIN_ID, or those of all sessions of this machine.
    """
    failed = False
    for one in _operators(domain):
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


def _stopped(arm: "ReportedArm") -> str:
    values = arm.values
    return (
        f"stopped, confirmed after {1000.0 * arm.stopped_after:.0f} ms; at rest "
        f"{1000.0 * values['rest_time']:.0f} ms after the stop message; stopping distance "
        f"{1000.0 * values['travel']:.2f} mm"
    )


def operate(*commands: Annotated[str, Parameter(name="COMMAND")], arm: str | None = None, domain: Domain = None) -> int:
    """Enable, home, pause or reset arms, or show their states.

    Without commands it says how the arms are; commands are sent one after the other:

        teleop operate
        teleop operate enable home           # an arm that waits for people
        teleop operate release reset enable  # after an emergency stop
        teleop operate pause --arm left      # one arm of several

    Args:
        commands: release, enable, disable, pause, resume, home, unhome, reset or stop.
        arm: Namespace of one arm; without it, all arms.
        domain: ROS domain; without it, ROS_DOMAIN_ID, or those of all sessions of this machine.
    """
    code = 0
    for one in _operators(domain):
        with one as operator:
            names = [arm] if arm is not None else list(operator.look())
            for word in commands:
                for name in names:
                    is_done, text = operator.command(word, name)
                    print(f"{name or 'arm'}: {text}")
                    code = code or (0 if is_done else 1)
            if not commands:
                for name, found in operator.arms.items():
                    print(f"{name or 'arm'} on ROS domain {operator.domain}: {found.text}")
    return code
