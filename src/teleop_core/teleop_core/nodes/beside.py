"""Beside: processes that a live session starts for its stages, such as cameras, and that it can do without.

They start after the nodes and end before the recorder. If one ends early or hangs, the session says so and goes on.
"""

import tempfile
from collections.abc import Callable, Mapping
from typing import IO, Any, cast

from teleop_core.base.errors import SessionError
from teleop_core.graph.stage import Beside
from teleop_core.nodes.children import Child
from teleop_core.nodes.starter import Starter
from teleop_core.session.configuration import Configuration

_MAIN = "teleop_core.commands.cli:main"


def processes_beside(configuration: Configuration) -> dict[str, Beside]:
    """Processes beside a session, by name; arms that share a scene share its cameras."""
    found = dict[tuple[str, ...], Beside]()
    for member in configuration.graph.members:
        make = member.stage.beside
        if make is not None and (one := make(configuration.groups[member.name])) is not None:
            found.setdefault(one.words, one)
    return {one.words[0] + (f"_{k}" if k else ""): one for k, one in enumerate(found.values())}


class BesideSession:
    """The processes beside one session.

    Args:
        configuration: Configuration of the session.
        env: Environment variables of the processes.
        starter: Starter of the session.
        say: Called with each line for the user.

    Attributes:
        ended: Number of processes that ended early or hung.
    """

    def __init__(
        self, configuration: Configuration, env: Mapping[str, str], starter: Starter, say: Callable[[str], object]
    ) -> None:
        self._given, self._env, self._starter, self._say = processes_beside(configuration), dict(env), starter, say
        self._children = dict[str, Child]()
        self._well = list[Child]()
        # The system removes a file without a name when the last process has closed it.
        self._parameters = cast("IO[Any]", tempfile.TemporaryFile("w+", encoding="utf-8"))  # noqa: SIM115
        self._parameters.write(configuration.text())
        self._parameters.flush()
        self.ended = 0

    def start(self) -> None:
        """Start all processes, without waiting for them."""
        for name, one in self._given.items():
            command = ["teleop", *one.words, "--config", "/dev/fd/<parameters>"]
            child = Child(name, self._parameters, self._env, self._starter, command, main=_MAIN)
            self._children[name] = child
            self._well.append(child)
            self._say(f"{name} starts, beside the session")

    def check(self) -> None:
        """Say once which processes ended or hang."""
        for child in list(self._well):
            try:
                child.check()
            except SessionError as error:
                self._well.remove(child)
                self.ended += 1
                self._say(f"{error}\nthe session goes on without {child.name}")

    def close(self) -> None:
        """End the processes, and say what they did."""
        total = len(self._children)
        for child in self._well:
            child.ask()
        for name, child in self._children.items():
            code = child.end()
            if child in self._well:
                self.ended += code != 0
                self._say(f"{name}{child.last_words()}")
            child.close()
        self._children.clear()
        self._well.clear()
        self._parameters.close()
        if total:
            self._say(f"beside the session: {total} started, {self.ended} ended early")
