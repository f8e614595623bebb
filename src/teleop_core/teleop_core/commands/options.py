"""Options that several commands share, and what commands do with them.

A command is a typed function: its parameters are the options, its docstring is the help. Lists take several words
after one option, except :data:`Files` and :data:`Nodes`, whose options are repeated.
"""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from teleop_core.base.errors import TeleopError

if TYPE_CHECKING:
    from teleop_core.session.configuration import Configuration

ONCE = Parameter(consume_multiple=False)
Words = tuple[str, ...]
Files = Annotated[tuple[Path, ...], ONCE]
Nodes = Annotated[tuple[str, ...], Parameter(consume_multiple=False, metavar="NODE")]
Geometry = Annotated[tuple[str, ...], Parameter(metavar="SYMBOL=VALUE")]


def _domain(_: object, tokens: Any) -> int:
    from teleop_core.middleware.domains import checked_domain

    return checked_domain("--domain", tokens[0].value)


Domain = Annotated[int | None, Parameter(converter=_domain, metavar="N")]


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class ParameterOptions:
    """Options for files and values of parameters."""

    config: Files = ()
    """ROS 2 parameter file that overrides the scenario; may be repeated."""
    set_: Annotated[Words, Parameter(name="--set", metavar="KEY=VALUE")] = ()
    """Set parameters; they override all files, e.g. fine_gain=0.2 slave.command_timeout=0.2."""

    @property
    def texts(self) -> list[str]:
        """Texts ``key=value`` of all given settings; later ones win."""
        return list(self.set_)


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class SessionOptions(ParameterOptions):
    """Options that configure a session."""

    robot: str | None = None
    """Slave: one of `teleop robot`, or a file, as --set robot=ROBOT."""
    geometry: Geometry = ()
    """Lengths and options that replace the published ones [m, rad], such as tip=tool0 of a URDF."""

    @property
    def texts(self) -> list[str]:
        """Texts ``key=value`` of all given settings; later ones win.

        Geometry and start of the former robot do not hold for another robot, hence its texts come first.
        """
        robot = [] if self.robot is None else [f"robot={self.robot}", "geometry=[]", "slave.start=[]"]
        geometry = [f"geometry={json.dumps(self.geometry)}"] if self.geometry else []
        return [*robot, *geometry, *self.set_]

    def configured(self, scenario: str | None, more: Words | list[str] = ()) -> "Configuration":
        """Configuration of a session: the scenario, then the files, then the texts, then ``more`` texts."""
        from teleop_core.session import api

        return api.configuration(scenario, files=self.config, texts=[*self.texts, *more])


def done(out: Path, what: str) -> str:
    """Last line that a command prints after it has recorded."""
    return f"{out}: {what}; next: teleop evaluate {out}"


def ros_module(module: str, package: str = "teleop_core.nodes") -> Any:
    """Module of the nodes, which are the only part that needs ROS.

    Args:
        module: Name of the module in the package.
        package: The package of the module.

    Raises:
        TeleopError: ROS is missing.
    """
    from importlib import import_module

    try:
        return import_module(f"{package}.{module}")
    except ModuleNotFoundError as error:
        if (error.name or "").startswith("teleop_"):
            raise
        raise TeleopError(
            f"needs ROS 2 ({error.name} is missing): pip install 'teleop_core[ros]' or source ROS"
        ) from error
