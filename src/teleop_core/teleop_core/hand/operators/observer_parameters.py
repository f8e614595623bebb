"""Parameters of the operator ``observer``: how it sees, waits, moves and turns."""

from dataclasses import dataclass

from teleop_core.base import parameter

_FITTED = "fitted: to the four times of movement of MacKenzie and Ware 1993"


@dataclass(frozen=True, kw_only=True)
class ObserverParameters:
    """How the operator sees, waits and moves."""

    eye: float = parameter(
        0.13,
        unit="s",
        lower=0.0,
        upper=1.0,
        fixed=True,
        doc="from when something is seen or felt to when a plan can use it",
        source="published: 0.110 to 0.163 s in six studies of corrections by sight",
    )
    reaction: float = parameter(
        0.25, unit="s", lower=0.0, upper=2.0, fixed=True, doc="from a new goal to the first submovement", source=_FITTED
    )
    least_time: float = parameter(
        0.06,
        unit="s",
        lower=0.02,
        upper=1.0,
        fixed=True,
        doc="duration of a submovement of no difficulty",
        source=_FITTED,
    )
    time_per_bit: float = parameter(
        0.02, unit="s", lower=0.0, upper=1.0, fixed=True, doc="what each bit of difficulty adds to it", source=_FITTED
    )
    noise: float = parameter(
        0.04,
        unit="s",
        lower=0.0,
        upper=0.5,
        fixed=True,
        doc="standard deviation of a submovement's end along its way, per mean speed",
        source=_FITTED + "; linear in speed: Meyer et al. 1988",
    )
    noise_across: float = parameter(
        0.36,
        lower=0.0,
        upper=1.0,
        fixed=True,
        doc="the same across its way, per that along it",
        source="assumed: as of the operator human",
    )
    error_cost: float = parameter(
        0.0,
        unit="s",
        lower=0.0,
        upper=100.0,
        off=0.0,
        fixed=True,
        doc="time that an error costs: it presses unseen where that is worth the wait; 0: never",
    )
    fastest: float = parameter(
        0.04,
        unit="m/s",
        lower=0.005,
        upper=10.0,
        fixed=True,
        doc="largest mean speed of a submovement of the hand; its peak is 1.9 times that",
        source="fitted: 95 % at 65 mm/s while it moves, UVA-DSA telesurgery QoS analysis 2026",
    )
    longest_wait: float = parameter(
        3.0,
        unit="s",
        lower=0.1,
        upper=60.0,
        fixed=True,
        doc="after which it goes on, though its last motion did not show; less once it knows how late a motion shows",
        source="assumed: as the longest outage of the UVA-DSA telesurgery QoS analysis 2026",
    )
    fastest_turn: float = parameter(
        0.8,
        unit="rad/s",
        lower=0.05,
        upper=20.0,
        fixed=True,
        doc="largest mean speed of a turn of the hand",
        source="assumed",
    )
    largest_turn: float = parameter(
        1.0,
        unit="rad",
        lower=0.1,
        upper=3.0,
        fixed=True,
        doc="turn of the stylus at which the wrist ends",
        source="assumed: wrists turn by 1.3 rad to each side (Boone and Azen 1979), and nobody works at the end",
    )
    softness: float = parameter(
        0.003,
        unit="m/N",
        lower=1e-5,
        upper=0.1,
        fixed=True,
        doc="way for a newton that it expects of what it presses first, before it has felt how soft that is",
        source="assumed: as task.palpate.yielding",
    )
    axes: tuple[str, ...] = parameter(
        ("-z", "-x", "+y"), length=3, fixed=True, doc="axes of the hand along x, y, z of the slave, as motion_scaling's"
    )
    tool_axes: tuple[str, ...] = parameter(
        ("-y", "-x", "-z"),
        length=3,
        fixed=True,
        doc="axes of the stylus along x, y, z of the tool, as motion_scaling's with its tool_roll",
    )
