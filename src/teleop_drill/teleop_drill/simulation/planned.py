"""Planned: a schedule as a text, with all that is needed to run it again to the same bits."""

import json
import shlex
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from teleop_core.base.errors import ParameterError, RecordingError
from teleop_core.nodes.crews import Processes
from teleop_drill.simulation.schedules import KINDS, OF_PROCESS, Fault
from teleop_drill.simulation.seeds import PROCESSES, Found, Starts, run_seed
from teleop_drill.simulation.visits import PLAIN, SESSIONS

VERSION = 2
"""Version of the form of a schedule."""
_LONGEST = 60.0
"""Latest begin and longest duration of a fault of a given schedule [s]."""
_MOST = 100
"""Largest number of faults of a given schedule."""
DEPTHS = 9
"""Largest depth of a schedule."""


@dataclass(frozen=True)
class Schedule:
    """All that is needed to run a schedule again to the same bits.

    Attributes:
        seed: Seed of all random numbers of the machine.
        faults: The faults.
        processes: Distribution of the nodes over processes.
        breaks: As in :func:`~teleop_drill.simulation.seeds.run_seed`.
        depth: As in :class:`~teleop_drill.simulation.scheduler.Scheduler`.
        session: Kind of session, one of :data:`~teleop_drill.simulation.visits.SESSIONS`.
    """

    seed: int
    faults: tuple[Fault, ...]
    processes: Processes = Processes.SIDES
    breaks: float = 0.0
    depth: int = 0
    session: str = PLAIN

    @classmethod
    def of_found(cls, found: Found) -> "Schedule":
        """Schedule that had a result."""
        return cls(found.seed, found.faults, found.processes, found.breaks, found.depth, found.session)

    def run(self, folder: Path | None = None) -> Found:
        """Run the schedule; the recording is kept in a folder if one is given."""
        return run_seed(self.seed, self.faults, folder, self.processes, self.breaks, self.depth, self.session)

    def run_in(self, starts: Starts) -> tuple[Found, list[str]]:
        """Run the schedule after a start that it shares with others; returns its result and the branches that ran."""
        return starts.run(self.seed, self.faults, self.processes, self.breaks, self.depth, self.session)

    def plain(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return {
            "version": VERSION,
            "seed": self.seed,
            "nodes": self.processes.value,
            "breaks": self.breaks,
            "depth": self.depth,
            "session": self.session,
            "faults": [[one.at, one.kind, one.where, one.seconds, one.amount] for one in self.faults],
        }

    def command(self) -> str:
        """Command that runs the schedule again."""
        return f"teleop drill --schedule {shlex.quote(json.dumps(self.plain()))}"

    @classmethod
    def of(cls, text: str) -> "Schedule":
        """Schedule of a JSON text, or of the file that the text names.

        Raises:
            ParameterError: The text or a value in it is not a schedule, or has another version.
            RecordingError: The file cannot be read.
        """
        if text.lstrip().startswith("{"):
            return cls._of_plain(json_object(text, "--schedule"))
        return cls._of_plain(json_object(read(Path(text)), text))

    @classmethod
    def _of_plain(cls, plain: dict[str, Any]) -> "Schedule":
        check_version(plain, "the schedule")
        values: list[Any] = [plain.get(name) for name in ("seed", "nodes", "breaks", "depth", "session")]
        seed, nodes, breaks, depth, session = values
        if isinstance(seed, bool) or not isinstance(seed, int):
            raise ParameterError("seed of the schedule", seed, "an integer")
        if nodes not in [one.value for one in PROCESSES]:
            raise ParameterError("nodes of the schedule", nodes, f"of {', '.join(one.value for one in PROCESSES)}")
        if not _is_number(breaks, 0.1):
            raise ParameterError("breaks of the schedule", breaks, "from 0 to 0.1")
        if isinstance(depth, bool) or depth not in range(DEPTHS + 1):
            raise ParameterError("depth of the schedule", depth, f"an integer from 0 to {DEPTHS}")
        if not isinstance(session, str) or session not in SESSIONS:
            raise ParameterError("session of the schedule", session, f"of {', '.join(SESSIONS)}")
        faults, processes = plain.get("faults"), Processes(nodes)
        if not isinstance(faults, list) or len(faults) > _MOST:
            raise ParameterError("faults of the schedule", faults, f"a list of at most {_MOST}")
        return cls(seed, tuple(_fault(one, processes) for one in faults), processes, breaks, depth, session)


def _fault(values: object, processes: Processes) -> Fault:
    if not isinstance(values, list) or len(values) != 5:
        raise ParameterError("a fault of the schedule", values, "[begin, kind, process, duration, amount]")
    at, kind, where, seconds, amount = values
    if not isinstance(kind, str) or kind not in KINDS:
        raise ParameterError("the kind of a fault of the schedule", kind, f"of {', '.join(sorted(KINDS))}")
    if kind not in OF_PROCESS:
        where = ""
    elif where not in PROCESSES[processes]:
        raise ParameterError("the process of a fault of the schedule", where, f"of {', '.join(PROCESSES[processes])}")
    for name, value, most in (("begin", at, _LONGEST), ("duration", seconds, _LONGEST), ("amount", amount, 1.0)):
        if not _is_number(value, most):
            raise ParameterError(f"the {name} of a fault of the schedule", value, f"from 0 to {most:g}")
    return Fault(at, kind, where, seconds, amount)


def _is_number(value: object, most: float) -> bool:
    """Whether a value is a number from 0 to ``most``."""
    return isinstance(value, int | float) and not isinstance(value, bool) and 0.0 <= value <= most


def check_version(plain: dict[str, Any], name: str) -> None:
    """Check that a text has the present version.

    Raises:
        ParameterError: It has another one.
    """
    if plain.get("version") != VERSION:
        raise ParameterError(f"version of {name}", plain.get("version"), f"{VERSION}, which this program reads")


def read(path: Path) -> str:
    """Text of a file.

    Raises:
        RecordingError: The file cannot be read.
    """
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise RecordingError(path, f"cannot be read as a schedule: {error}") from error


def json_object(text: str, name: str) -> dict[str, Any]:
    """JSON object of a text.

    Raises:
        ParameterError: The text is no JSON object.
    """
    try:
        found = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise ParameterError(name, text, f"JSON of a schedule ({error})") from error
    if not isinstance(found, dict):
        raise ParameterError(name, text, "a JSON object of a schedule")
    return found
