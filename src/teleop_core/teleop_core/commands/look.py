"""``teleop topic``, ``param``, ``service`` and ``info``: what ``ros2`` shows, where ROS comes from PyPI."""

import argparse
from collections.abc import Iterable
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

from teleop_core.base.errors import ParameterError
from teleop_core.commands.arguments import command, ros_module
from teleop_core.commands.operate import chosen_domains

if TYPE_CHECKING:
    from teleop_core.nodes.looking import Look, Rate

_TOPIC = """\
  teleop topic list                          topics with types, publishers and readers
  teleop topic hz /slave/measured_js         rate, each second
  teleop topic echo /slave/measured_cp       messages as YAML
"""
_PARAM = """\
  teleop param list                          nodes with parameters
  teleop param list motion_scaling           parameters of a node, with their values
  teleop param get motion_scaling fine_gain
  teleop param set motion_scaling fine_gain 0.2
"""
_SERVICE = """\
  teleop service list
  teleop service call /recorder/split        a service of the type std_srvs/srv/Trigger
"""
_PART = 1000  # largest number of array elements that are printed


def add(commands: Any) -> None:
    """Add the parsers of the commands."""
    topic = command(commands, "topic", _topic, "list topics of running nodes, measure rates, print messages", _TOPIC)
    topic.add_argument("action", choices=("list", "hz", "echo"))
    topic.add_argument("name", nargs="?", metavar="TOPIC", help="topic, for hz and echo")
    topic.add_argument("--count", type=int, metavar="N", help="end after N messages, or N lines of hz")
    param = command(commands, "param", _param, "list, read and set parameters of running nodes", _PARAM)
    param.add_argument("action", choices=("list", "get", "set"))
    for name, text in (("node", "node"), ("name", "parameter, for get and set"), ("value", "value, for set")):
        param.add_argument(name, nargs="?", metavar=name.upper(), help=text)
    service = command(commands, "service", _service, "list services of running nodes, and call one", _SERVICE)
    service.add_argument("action", choices=("list", "call"))
    service.add_argument("name", nargs="?", metavar="SERVICE", help="service, for call")
    for parser in (topic, param, service):
        parser.add_argument("--domain", type=int, metavar="N", help="ROS domain (default: as for `teleop operate`)")
    info = command(commands, "info", _info, "show the topics and the metadata of a recording")
    info.add_argument("bag", type=Path, metavar="BAG", help="recording")


def _look(arguments: argparse.Namespace) -> "Look":
    from teleop_core.nodes.children import environment

    module = ros_module("looking")
    environment()
    found = chosen_domains(arguments)
    if len(found) > 1:
        raise ParameterError("--domain", None, f"one of {', '.join(map(str, found))}: several sessions run here")
    look: Look = module.Look(found[0])
    return look


def _named(name: str | None, what: str, action: str) -> str:
    if name is None:
        raise ParameterError(what, None, f"given for {action}")
    return name


def _topic(arguments: argparse.Namespace) -> int:
    with _look(arguments) as look:
        if arguments.action == "list":
            for name, seen in look.topics().items():
                print(f"{name}  {seen.ros_type}  {seen.publishers} publishers, {seen.readers} readers")
            return 0
        name = _named(arguments.name, "TOPIC", arguments.action)
        if arguments.action == "hz":
            for rate in islice(look.rates(name), arguments.count):
                print(_rate_text(rate), flush=True)
            return 0
        for message in islice(look.messages(name), arguments.count):
            print(f"{text_of(message)}---", flush=True)
    return 0


def _rate_text(rate: "Rate") -> str:
    if not rate.number:
        return "0.0 Hz, no message"
    return f"{1.0 / max(rate.mean, 1e-9):.1f} Hz, {1e3 * rate.shortest:.2f} to {1e3 * rate.longest:.2f} ms apart"


def _param(arguments: argparse.Namespace) -> int:
    with _look(arguments) as look:
        if arguments.action == "list" and arguments.node is None:
            _show(look.nodes())
            return 0
        node = _named(arguments.node, "NODE", arguments.action)
        if arguments.action == "list":
            _show(f"{name}: {_told(value)}" for name, value in look.parameters(node).items())
            return 0
        name = _named(arguments.name, "NAME", arguments.action)
        if arguments.action == "set":
            look.change(node, name, _value(_named(arguments.value, "VALUE", "set")))
        print(_told(look.parameter(node, name)))
    return 0


def _service(arguments: argparse.Namespace) -> int:
    with _look(arguments) as look:
        if arguments.action == "list":
            _show(f"{name}  {kind}" for name, kind in look.services().items())
            return 0
        is_done, text = look.trigger(_named(arguments.name, "SERVICE", "call"))
    print(text or ("done" if is_done else "refused"))
    return 0 if is_done else 1


def _info(arguments: argparse.Namespace) -> int:
    from datetime import UTC, datetime

    from teleop_core.bags.reader import Bag
    from teleop_core.base.texts import printable

    bag = Bag(arguments.bag)
    seconds = 1e-9 * (bag.end_ns - bag.start_ns)
    begin = datetime.fromtimestamp(1e-9 * bag.start_ns, UTC)
    count = sum(info.count for info in bag.topics.values())
    print(f"{bag.path}: {seconds:.3f} s from {begin:%Y-%m-%d %H:%M:%S} UTC, {count} messages")
    wide = max(len(name) for name in bag.topics)
    for name, info in sorted(bag.topics.items()):
        rate = f"{(info.count - 1) / seconds:8.1f} Hz" if info.count > 1 and seconds > 0.0 else ""
        print(printable(f"  {name:{wide}}  {info.count:8}  {info.type}  {rate}".rstrip()))
    for name, text in sorted(bag.metadata.items()):
        first = printable(text.split("\n", 1)[0])[:100]
        print(printable(f"  {name}: {first}"))
    return 0


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
