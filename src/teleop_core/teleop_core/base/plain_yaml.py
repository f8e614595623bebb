"""Plain YAML: reads files and settings, with limits on the cost of reading, and writes them.

The format is YAML 1.1 as PyYAML's safe loader reads it, except that dates stay texts. Recursive aliases, aliases that
expand to too many values, overlong numbers, and a key that stands twice in one mapping are refused. If PyYAML includes
libyaml, libyaml reads and writes: the values are the same, and it is five times as fast.
"""

import stat
from pathlib import Path
from typing import Any

import yaml

from teleop_core.base.errors import TeleopError
from teleop_core.base.texts import shown

LARGEST_TEXT = 1 << 20
"""Largest size of a file [bytes], which takes two seconds to read. The parameters in a recording have five thousand
bytes."""
MOST_VALUES = 50_000
"""Largest number of values in a text; aliases count as often as they are used."""
LONGEST_NUMBER = 400
"""Largest number of characters of a number: the longest double, written out, has 309 digits before its point."""
DEEPEST = 100
"""Largest depth of nested lists and mappings; libyaml's composer has no limit of its own."""
_DATE = "tag:yaml.org,2002:timestamp"
_MERGE = "tag:yaml.org,2002:merge"
_NUMBERS = ("tag:yaml.org,2002:int", "tag:yaml.org,2002:float")


class UnreadableError(ValueError):
    """A text is not YAML as this package reads it; the error gives the reason in one line."""


_BEGINS, _ENDS = yaml.CollectionStartEvent, yaml.CollectionEndEvent


class _Loader(getattr(yaml, "CSafeLoader", yaml.SafeLoader)):  # type: ignore[misc]
    """Safe loader without dates."""

    yaml_implicit_resolvers = {  # noqa: RUF012  (PyYAML's own form)
        first: [(tag, form) for tag, form in entries if tag != _DATE]
        for first, entries in yaml.SafeLoader.yaml_implicit_resolvers.items()
    }


class _Dumper(getattr(yaml, "CSafeDumper", yaml.SafeDumper)):  # type: ignore[misc]
    """Writer that repeats equal parts in full; it writes no references to earlier parts: rcl cannot read them."""

    def ignore_aliases(self, data: Any) -> bool:
        """Return True: equal parts are never written as references."""
        return True


def written(value: Any, **options: Any) -> str:
    """YAML text of a value: mappings keep their order, and repeated parts are written out instead of aliased.

    Args:
        value: Mappings, lists, texts, numbers, truth values or None.
        options: Options of ``yaml.dump``, such as ``width``.
    """
    return str(yaml.dump(value, Dumper=_Dumper, sort_keys=False, allow_unicode=True, **options))


def parse(text: str) -> Any:
    """Value of a text: mappings, lists, texts, numbers, truth values or None.

    Raises:
        UnreadableError: The text is not YAML, or reading it would cost too much.
    """
    if len(text) > LARGEST_TEXT:
        raise UnreadableError(f"has {len(text)} characters, must have at most {LARGEST_TEXT}")
    try:
        _check_depth(text)
        loader = _Loader(text)
        node = loader.get_single_node()
        if node is None:
            return None
        _count(loader, node, {}, set())
        return loader.construct_document(node)
    except yaml.MarkedYAMLError as error:
        raise UnreadableError(_told(error)) from error
    except UnreadableError:
        raise
    # Constructors of explicit tags, such as "!!int x", raise exceptions of many kinds.
    except (yaml.YAMLError, ValueError, TypeError, KeyError, AttributeError, IndexError) as error:
        raise UnreadableError(f"is not YAML: {' '.join(str(error).split())}") from error


def _check_depth(text: str) -> None:
    depth = 0
    for event in yaml.parse(text, _Loader):
        depth += isinstance(event, _BEGINS) - isinstance(event, _ENDS)
        if depth > DEEPEST:
            raise UnreadableError(f"is nested too deeply, more than {DEEPEST} levels")


def _told(error: yaml.MarkedYAMLError) -> str:
    said = " ".join(filter(None, (error.context, error.problem)))
    mark = error.problem_mark or error.context_mark
    place = f" (line {mark.line + 1}, column {mark.column + 1})" if mark else ""
    return f"is not YAML: {said}{place}"


def _check_keys(loader: Any, node: yaml.MappingNode) -> None:
    """Refuse a key that stands twice; PyYAML would take the last one. Keys of a merge (``<<``) may be overridden."""
    lines: dict[Any, int] = {}
    for key, _ in node.value:
        if not isinstance(key, yaml.ScalarNode):
            continue  # no mapping can have such a key
        name = _MERGE if key.tag == _MERGE else loader.construct_object(key)
        line = key.start_mark.line + 1
        if name in lines:
            raise UnreadableError(f"has the key {shown(key.value)} twice, in lines {lines[name]} and {line}")
        lines[name] = line


def _count(loader: Any, node: yaml.Node, known: dict[int, int], within: set[int]) -> int:
    """Number of values that a node expands to, with its aliases.

    Raises:
        UnreadableError: The node contains itself, or there are too many values, or a number is too long, or a key
            stands twice.
    """
    if isinstance(node, yaml.ScalarNode):
        if node.tag in _NUMBERS and len(node.value) > LONGEST_NUMBER:
            text = f"has a number of {len(node.value)} characters, more than {LONGEST_NUMBER}"
            raise UnreadableError(text)
        return 1
    if id(node) in within:
        raise UnreadableError("has an alias that refers to itself")
    if id(node) in known:
        return known[id(node)]
    within.add(id(node))
    entries = node.value
    if isinstance(node, yaml.MappingNode):
        _check_keys(loader, node)
        entries = [part for pair in node.value for part in pair]
    total = 1 + sum(_count(loader, entry, known, within) for entry in entries)
    within.discard(id(node))
    if total > MOST_VALUES:
        raise UnreadableError(f"expands to more than {MOST_VALUES} values, perhaps by aliases")
    known[id(node)] = total
    return total


def load(path: Path) -> Any:
    """Value of a file that a user named.

    Raises:
        TeleopError: The file cannot be read, or is not YAML; the message names the file.
    """
    try:
        return read(path)
    except OSError as error:
        raise TeleopError(f"{path}: cannot be read: {error.strerror}") from error
    except UnreadableError as error:
        raise TeleopError(f"{path}: {error}") from error


def read(path: Path) -> Any:
    """Value of a file, as returned by :func:`parse`.

    Raises:
        OSError: The file cannot be read.
        UnreadableError: It is a pipe or device, too large, not UTF-8, or not YAML.
    """
    return parse(read_text(path))


def read_text(path: Path) -> str:
    """Text of a regular file of at most :data:`LARGEST_TEXT` bytes. Raises the same errors as :func:`read`."""
    try:
        check_regular(path)
        with path.open("rb") as file:
            data = file.read(LARGEST_TEXT + 1)
        if len(data) > LARGEST_TEXT:
            raise UnreadableError(f"has more than {LARGEST_TEXT} bytes")
        return data.decode("utf-8")
    except UnicodeDecodeError as error:
        raise UnreadableError(f"is not UTF-8 ({error.reason} at byte {error.start})") from error


def check_regular(path: Path) -> None:
    """Make sure that a path is a regular file, not a pipe or a device.

    Raises:
        OSError: The path does not exist.
        UnreadableError: The path is not a regular file.
    """
    try:
        mode = path.stat().st_mode
    except ValueError as error:  # the file name contains a zero byte
        raise UnreadableError(f"is no valid file name: {error}") from error
    if not stat.S_ISREG(mode) and not stat.S_ISDIR(mode):  # reading a directory raises a clear error itself
        raise UnreadableError("is a pipe or a device, must be a file")
