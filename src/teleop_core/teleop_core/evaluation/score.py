"""Score: everything that is measured on one recording, and its keys in JSON."""

import math
from dataclasses import dataclass, fields, is_dataclass
from typing import Any, NamedTuple

from teleop_core.evaluation.accumulators import Delay, Spread
from teleop_core.evaluation.fixture_scores import FixtureScore
from teleop_core.evaluation.streams import TopicScore
from teleop_core.evaluation.ticks import Ticks


class Key(NamedTuple):
    """A JSON key: path with dots (<…> stands for any name), unit, and meaning."""

    path: str
    unit: str
    meaning: str


_ERROR = "rms, sample S.D. (n − 1), largest"
KEYS = (
    Key("session.name", "", "name of the recording"),
    Key("session.scenario", "", "scenario it was made with; null if unknown"),
    Key("session.robot", "", "robot; null if unknown"),
    Key("session.seed", "", "random seed; null if unknown"),
    Key("session.duration_s", "s", "first to last message"),
    Key("session.gain", "m/m", "gain that was in force most of the time; null if unknown"),
    Key("samples.scored", "", "slave poses with their reference"),
    Key("samples.unpaired", "", "slave poses whose reference was lost on the way"),
    Key("samples.invalid", "", "slave poses or references with NaN or without a direction"),
    Key("position_error_mm.rms|sd|max", "mm",
        f"slave/measured_cp to slave/setpoint_cp of the same tick: {_ERROR}"),
    Key("orientation_error_deg.roll|pitch|yaw.rms|sd|max", "deg",
        f"difference of the fixed angles of the same two, wrapped to ±180: {_ERROR}"),
    Key("orientation_error_deg.angle.rms|sd|max", "deg",
        f"angle of the one rotation between the same two: {_ERROR}"),
    Key("orientation_error_deg.degenerate_share", "1",
        "share of samples with pitch within 1° of ±90°, left out of roll and yaw"),
    Key("command_error_mm.rms|sd|max", "mm",
        f"slave/measured_cp to the latest slave/servo_cp at its stamp: {_ERROR}"),
    Key("command_orientation_error_deg.roll|pitch|yaw.rms|sd|max", "deg",
        f"difference of the fixed angles of the same two: {_ERROR}"),
    Key("command_orientation_error_deg.angle.rms|sd|max", "deg",
        f"angle of the one rotation between the same two: {_ERROR}"),
    Key("command_orientation_error_deg.degenerate_share", "1", "as above"),
    Key("fixture.on_s", "s", "time with the box on"),
    Key("fixture.outside_share", "1", "share of that time with the slave's tip outside"),
    Key("fixture.penetration_max_mm", "mm", "largest distance of the slave's tip from the box"),
    Key("fixture.penetration_rms_mm", "mm", "root mean square of it, zero inside"),
    Key("fixture.hand_penetration_max_mm", "mm", "largest distance of the hand from its box"),
    Key("force_n.rms|sd|max", "N", f"magnitude of the force on the hand: {_ERROR}"),
    Key("latency_ms.<stage>.median|p99|max", "ms",
        "own delay of haptic_master, motion_scaling, inverse_kinematics, slave_sim: from the "
        "arrival at the recorder of what it answers to that of its answer; haptic_master and "
        "total: from the stamp of the sample to the arrival of measured_cp and setpoint_js"),
    Key("ticks.executed|late|missed", "", "control ticks of the slave; late is null if uncounted"),
    Key("nodes.<node>.<name>", "", "counts that the nodes reported last on diagnostics"),
    Key("topics.<name>.count", "", "messages"),
    Key("topics.<name>.gaps", "",
        "messages missing by their stamps, lost or passed over by a stage that takes only the "
        "newest; null if not a stream"),
)  # fmt: skip
"""Every key of the JSON, in its order. Numbers are finite; null stands for not applicable."""


def key_table() -> str:
    """The keys as a Markdown table, for documents."""
    rows = (f"| `{key.path.replace('|', ', ')}` | {key.unit} | {key.meaning} |" for key in KEYS)
    return "\n".join(("| key | unit | meaning |", "|---|---|---|", *rows))


@dataclass(frozen=True)
class Session:
    """Which recording was scored; texts as in its metadata, None if it has none."""

    name: str
    scenario: str | None
    robot: str | None
    seed: int | None
    duration_s: float
    gain: float | None

    @property
    def title(self) -> str:
        """Name for people."""
        return self.scenario or self.name


@dataclass(frozen=True)
class Samples:
    """How many slave poses were scored, and why others were not."""

    scored: int
    unpaired: int
    invalid: int


@dataclass(frozen=True)
class OrientationError:
    """Spread of the orientation errors, [deg]; see :data:`KEYS`."""

    roll: Spread
    pitch: Spread
    yaw: Spread
    angle: Spread
    degenerate_share: float | None


@dataclass(frozen=True)
class Score:
    """Score of one recording; :data:`KEYS` says what each entry means."""

    session: Session
    samples: Samples
    position_error_mm: Spread
    orientation_error_deg: OrientationError
    command_error_mm: Spread
    command_orientation_error_deg: OrientationError
    fixture: FixtureScore
    force_n: Spread
    latency_ms: dict[str, Delay]
    ticks: Ticks
    nodes: dict[str, dict[str, int]]
    topics: dict[str, TopicScore]

    def to_json(self) -> dict[str, Any]:
        """The score as plain dictionaries with the keys of :data:`KEYS`."""
        plain: dict[str, Any] = _plain(self)
        return plain


def _plain(value: Any) -> Any:
    """Dictionaries, texts and numbers; what is not finite becomes None."""
    if is_dataclass(value):
        return {field.name: _plain(getattr(value, field.name)) for field in fields(value)}
    if isinstance(value, dict):
        return {str(name): _plain(entry) for name, entry in value.items()}
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    return value
