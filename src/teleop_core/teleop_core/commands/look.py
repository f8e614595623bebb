"""``teleop topic``, ``param``, ``service`` and ``info``: what ``ros2`` shows, where ROS comes from PyPI."""

from collections.abc import Iterable
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from teleop_core.base.errors import ParameterError
from teleop_core.commands.operate import chosen_domains
from teleop_core.commands.options import Domain, ros_module

if TYPE_CHECKING:
    from teleop_core.nodes.looking import LookingNode, Rate

_PART = 1000  # largest number of array elements that are printed


def _look(domain: int | None) -> "LookingNode":
    from teleop_core.nodes.children import environment

    module = ros_module("looking")
    environment()
    found = chosen_domains(domain)
    if len(found) > 1:
        raise ParameterError("--domain", None, f"one of {', '.join(map(str, found))}: several sessions run here")
    look: LookingNode = module.LookingNode(found[0])
    return look


def _named(name: str | None, what: str, action: str) -> str:
    if name is None:
        raise ParameterError(what, None, f"given for {action}")
    return name


def topic(
    action: Literal["list", "hz", "echo"],
    name: Annotated[str | None, Parameter(name="TOPIC")] = None,
    /,
    *,
    count: int | None = None,
    domain: Domain = None,
) -> None:
    """List topics of running nodes, measure rates, print messages.

    For example:

        teleop topic list                     # topics with types, publishers and readers
        teleop topic hz /slave/measured_js    # rate, each second
        teleop topic echo /slave/measured_cp  # messages as YAML

    Args:
        action: What to do.
        name: Topic, for hz and echo.
        count: End after this number of messages, or lines of hz.
        domain: ROS domain; without it, as for `teleop operate`.
    """
    with _look(domain) as look:
        if action == "list":
            for one, seen in look.topics().items():
                print(f"{one}  {seen.ros_type}  {seen.publishers} publishers, {seen.readers} readers")
            return
        name = _named(name, "TOPIC", action)
        if action == "hz":
            for rate in islice(look.rates(name), count):
                print(_rate_text(rate), flush=True)
            return
        for message in islice(look.messages(name), count):
            print(f"{text_of(message)}---", flush=True)


def _rate_text(rate: "Rate") -> str:
    if not rate.number:
        return "0.0 Hz, no message"
    return f"{1.0 / max(rate.mean, 1e-9):.1f} Hz, {1e3 * rate.shortest:.2f} to {1e3 * rate.longest:.2f} ms apart"


def param(
    action: Literal["list", "get", "set"],
    node: str | None = None,
    name: str | None = None,
    value: str | None = None,
    /,
    *,
    domain: Domain = None,
) -> None:
    """List, read and set parameters of running nodes.

    For example:

        teleop param list                 # nodes with parameters
        teleop param list motion_scaling  # parameters of a node, with their values
        teleop param get motion_scaling fine_gain
        teleop param set motion_scaling fine_gain 0.2

    Args:
        action: What to do.
        node: Node.
        name: Parameter, for get and set.
        value: Value, for set.
        domain: ROS domain; without it, as for `teleop operate`.
    """
    with _look(domain) as look:
        if action == "list" and node is None:
            _show(look.nodes())
            return
        node = _named(node, "NODE", action)
        if action == "list":
            _show(f"{name}: {_told(value)}" for name, value in look.parameters(node).items())
            return
        name = _named(name, "NAME", action)
        if action == "set":
            look.change(node, name, _value(_named(value, "VALUE", "set")))
        print(_told(look.parameter(node, name)))


def service(
    action: Literal["list", "call"],
    name: Annotated[str | None, Parameter(name="SERVICE")] = None,
    /,
    *,
    domain: Domain = None,
) -> int:
    """List services of running nodes, and call one.

    For example:

        teleop service list
        teleop service call /recorder/split  # a service of the type std_srvs/srv/Trigger

    Args:
        action: What to do.
        name: Service, for call.
        domain: ROS domain; without it, as for `teleop operate`.
    """
    with _look(domain) as look:
        if action == "list":
            _show(f"{one}  {kind}" for one, kind in look.services().items())
            return 0
        is_done, text = look.trigger(_named(name, "SERVICE", "call"))
    print(text or ("done" if is_done else "refused"))
    return 0 if is_done else 1


def info(bag: Path, /) -> None:
    """Show the topics and the metadata of a recording.

    Args:
        bag: Recording.
    """
    from datetime import UTC, datetime

    from teleop_core.bags.reader import Bag
    from teleop_core.base.texts import printable

    found = Bag(bag)
    seconds = 1e-9 * (found.end_ns - found.start_ns)
    begin = datetime.fromtimestamp(1e-9 * found.start_ns, UTC)
    count = sum(one.count for one in found.topics.values())
    print(f"{found.path}: {seconds:.3f} s from {begin:%Y-%m-%d %H:%M:%S} UTC, {count} messages")
    wide = max(len(name) for name in found.topics)
    for name, one in sorted(found.topics.items()):
        rate = f"{(one.count - 1) / seconds:8.1f} Hz" if one.count > 1 and seconds > 0.0 else ""
        print(printable(f"  {name:{wide}}  {one.count:8}  {one.type}  {rate}".rstrip()))
    for name, text in sorted(found.metadata.items()):
        first = printable(text.split("\n", 1)[0])[:100]
        print(printable(f"  {name}: {first}"))


def _show(lines: Iterable[str]) -> None:
    for line in lines:
        print(line)


def _told(value: Any) -> str:
    return str(list(value)) if isinstance(value, list | tuple) or hasattr(value, "tolist") else str(value)


def _value(text: str) -> Any:
    from teleop_core.base.plain_yaml import UnreadableError, parse

    try:
        return parse(text)
    except UnreadableError:
        return text


def text_of(message: Any) -> str:
    """Message as YAML."""
    import yaml

    from teleop_core.base.texts import printable

    text: str = yaml.safe_dump(_plain(message), sort_keys=False, allow_unicode=True)
    return "".join(f"{printable(line)}\n" for line in text.splitlines())


def _plain(value: Any) -> Any:
    if hasattr(value, "get_fields_and_field_types"):
        return {name: _plain(getattr(value, name)) for name in value.get_fields_and_field_types()}
    if isinstance(value, bytes):
        return list(value)
    if not isinstance(value, str) and (hasattr(value, "tolist") or isinstance(value, list | tuple)):
        found = [_plain(one) for one in list(value)[:_PART]]
        return found + [f"… {len(value)} in all"] * (len(value) > _PART)
    return value.item() if hasattr(value, "item") else value
