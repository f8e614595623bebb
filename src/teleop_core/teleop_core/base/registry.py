"""Registry: parts by name, from this package, from installed packages and from the running program.

Each seam (stages, operators, shapes, controllers, robots, metrics) has one registry. An installed
package adds parts through a Python entry-point group of the registry's name::

    [project.entry-points."teleop_core.shapes"]
    my_cone = "my_package.cone:CONE"

A program adds parts with :meth:`Registry.add`. No part is imported before it is requested.
"""

import re
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import is_dataclass
from functools import cache
from importlib import import_module
from importlib.metadata import EntryPoint, EntryPoints, entry_points
from types import MappingProxyType
from typing import Any, Generic, TypeVar

from teleop_core.base.errors import PartError, UnknownNameError

Part = TypeVar("Part")
_NAME = re.compile(r"\w[\w-]*")
ADDED: list[tuple["Registry[Any]", str]] = []
"""Parts that this program has added so far, in order."""


class Registry(Generic[Part]):
    """Named parts of one kind.

    Args:
        kind: Name of the kind in the singular, for messages: "fixture".
        kinds: Name of the kind in the plural; the entry-point group is ``<package>.<kinds>``.
        builtin: Maps names to import paths ``module:attribute`` in the package.
        check: Returns a part if it is valid, else raises :class:`~teleop_core.base.errors.PartError`.
        trial: Makes a trial run of a part that is not from the package, and raises the same errors as ``check``.
        package: Package that owns the registry.
        others: Alternative to a name, for messages: "FILE.urdf".
        base: Registry whose parts are also parts of this registry.
        elsewhere: Maps names of parts in other distributions of this project to these distributions.
    """

    def __init__(
        self,
        kind: str,
        kinds: str,
        builtin: Mapping[str, str],
        check: Callable[[str, object], Part],
        trial: Callable[[Part], None] | None = None,
        *,
        package: str = "teleop_core",
        others: tuple[str, ...] = (),
        base: "Registry[Part] | None" = None,
        elsewhere: Mapping[str, str] = MappingProxyType({}),
    ) -> None:
        self.kind, self.kinds, self.group = kind, kinds, f"{package}.{kinds}"
        self._builtin, self._check, self._trial = dict(builtin), check, trial
        self._others, self._base, self.elsewhere = others, base, dict(elsewhere)
        self.builtin = tuple(builtin)
        self._parts: dict[str, Part] = {}
        self._own: set[str] = set()
        self._installed: dict[str, EntryPoint] | None = None

        def register(part: Part, *, replace: bool = False) -> Part:
            """Add a part under its own name for the rest of the program; see :meth:`add`."""
            return self.add(getattr(part, "name", type(part).__name__), part, replace=replace)

        self.register = register
        """The function ``register``, which modules export under their own names."""

    def __iter__(self) -> Iterator[str]:
        return iter(self.names())

    def names(self) -> tuple[str, ...]:
        """Names of all parts: built in, installed, added."""
        base = self._base or ()
        return tuple(dict.fromkeys((*self._builtin, *base, *self._entries(), *self._parts)))

    def find(self, name: str) -> Part:
        """The part with the given name.

        Raises:
            UnknownNameError: There is no such part; the error lists the alternatives.
            PartError: An installed part cannot be loaded, is not a valid part, or is in another distribution of this
                project that is not installed.
        """
        if self._base is not None and name in self._base.names():
            return self._base.find(name)
        if name not in self._parts:
            part = self._check(name, self._load(name))
            if name not in self._builtin and self._trial is not None:
                self._trial(part)
            self._parts[name] = part
        return self._parts[name]

    def add(self, name: str, part: object, *, replace: bool = False) -> Part:
        """Add a part for the rest of this program; adding the same object again changes nothing.

        Args:
            name: Name of the part in configurations.
            part: The part.
            replace: Whether it may replace a part that the program added before, for example when a notebook's cell is
                run again.

        Raises:
            PartError: The name is already used, or the part is not valid.
        """
        if not (isinstance(name, str) and _NAME.fullmatch(name)):
            text = "named with letters, digits, _ and - only, because keys and file names contain the name"
            raise PartError(self.kind, name, text)
        checked = self._check(name, part)
        if self._parts.get(name) is checked:
            return checked
        is_ours = replace and name in self._own
        if not is_ours and name in self.names():
            raise PartError(self.kind, name, "given another name; this one is used already")
        if self._trial is not None:
            self._trial(checked)
        self._own.add(name)
        self._parts[name] = checked
        ADDED.append((self, name))
        return checked

    def remove(self, name: str) -> None:
        """Remove a part that the program added; its name is free again.

        Raises:
            UnknownNameError: The program added no part with this name; the error lists the added parts.
        """
        if name not in self._own:
            raise UnknownNameError(f"added {self.kind}", name, sorted(self._own) or ["none"])
        self._own.remove(name)
        del self._parts[name]

    def is_added(self, name: str) -> bool:
        """Whether a part was added by this program."""
        return name in self._own

    def _entries(self) -> dict[str, EntryPoint]:
        if self._installed is None:
            found: dict[str, EntryPoint] = {}
            for entry in _entry_points(tuple(sys.path))(group=self.group):
                if entry.name in self._builtin or entry.name in found:
                    package = self.group.partition(".")[0]
                    other = found[entry.name].value if entry.name in found else package
                    raise PartError(self.kind, entry.name, f"named once; {entry.value} and {other} both use it")
                found[entry.name] = entry
            self._installed = found
        return self._installed

    def _load(self, name: str) -> object:
        if (place := self._builtin.get(name)) is not None:
            module, _, attribute = place.partition(":")
            return getattr(import_module(module), attribute)
        if (entry := self._entries().get(name)) is None:
            if (distribution := self.elsewhere.get(name)) is not None:
                text = f"installed; it is in the distribution {distribution}"
                raise PartError(self.kind, name, text)
            raise UnknownNameError(self.kind, name, (*self.names(), *self._others))
        try:
            return entry.load()
        except Exception as error:  # any exception of a foreign module becomes a one-line error that names the module
            reason = f"{type(error).__name__}: {' '.join(str(error).split())}"
            expected = f"loadable from {entry.value} ({reason})"
            raise PartError(self.kind, name, expected) from error


def places(package: str, names: str) -> dict[str, str]:
    """Import paths of parts that are named like their files: ``NOTCH`` of ``notch.py`` for the name "notch"."""
    return {name: f"{package}.{name}:{name.upper()}" for name in names.split()}


@cache
def _entry_points(_path: tuple[str, ...]) -> Callable[..., EntryPoints]:
    """Entry points of all folders in ``sys.path``, read once for all registries."""
    return entry_points().select


def part_check(kind: str, form: type[Part], *calls: str) -> Callable[[str, object], Part]:
    """Check of a registry whose parts are dataclasses with ``parameters`` and functions.

    Args:
        kind: Kind of the registry's parts.
        form: Class of its parts.
        calls: Names of the attributes that must be callable.
    """

    def check(name: str, part: object) -> Part:
        if not isinstance(part, form):
            text = f"a {form.__name__}, not a {type(part).__name__}"
            raise PartError(kind, name, text)
        group = getattr(part, "parameters", None)
        if not (isinstance(group, type) and is_dataclass(group)):
            text = "one whose parameters are a dataclass, not an instance of one"
            raise PartError(kind, name, text)
        for field in calls:
            if not callable(getattr(part, field)):
                raise PartError(kind, name, f"one with a callable {field}")
        return part

    return check


@contextmanager
def tried(kind: str, name: str, needs: str) -> Iterator[None]:
    """Convert exceptions of a part inside this ``with`` into a :class:`PartError`.

    Args:
        kind: Kind of the registry's parts.
        name: Name of the part.
        needs: Requirement on the part: "one with ...".

    Raises:
        PartError: The part raised any exception, which is given in one line. A PartError is passed on unchanged.
    """
    try:
        yield
    except PartError:
        raise
    except Exception as error:
        reason = " ".join(str(error).split())
        raise PartError(kind, name, f"{needs}; it raises {type(error).__name__}: {reason}") from error
