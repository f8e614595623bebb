"""Parameters of the operator ``observer``: how it sees, waits, moves and turns."""

from dataclasses import dataclass

from teleop_core.base import Within, parameter

_FITTED = "fitted: to the four times of movement of MacKenzie and Ware 1993"


@dataclass(frozen=True, kw_only=True)
class ObserverParameters:
    """How the operator sees, waits and moves."""

    eye: float = parameter(
        0.13,
        Within(0.0, 1.0, "s"),
        "from when something is seen or felt to when a plan can use it",
        fixed=True,
        source="published: 0.110 to 0.163 s in six studies of corrections by sight",
    )
    reaction: float = parameter(
        0.25, Within(0.0, 2.0, "s"), "from a new goal to the first submovement", fixed=True, source=_FITTED
    )
    least_time: float = parameter(
        0.06, Within(0.02, 1.0, "s"), "duration of a submovement of no difficulty", fixed=True, source=_FITTED
    )
    time_per_bit: float = parameter(
        0.02, Within(0.0, 1.0, "s"), "what each bit of difficulty adds to it", fixed=True, source=_FITTED
    )
    noise: float = parameter(
        0.04,
        Within(0.0, 0.5, "s"),
        "standard deviation of a submovement's end along its way, per mean speed",
        fixed=True,
        source=_FITTED + "; linear in speed: Meyer et al. 1988",
    )
    noise_across: float = parameter(
        0.36,
        Within(0.0, 1.0),
        "the same across its way, per that along it",
        fixed=True,
        source="assumed: as of the operator human",
    )
    error_cost: float = parameter(
        0.0,
        Within(0.0, 100.0, "s"),
        "time that an error costs: it presses unseen where that is worth the wait; 0: never",
        off=0.0,
        fixed=True,
    )
    fastest: float = parameter(
        0.04,
        Within(0.005, 10.0, "m/s"),
        "largest mean speed of a submovement of the hand; its peak is 1.9 times that",
        fixed=True,
        source="fitted: 95 % at 65 mm/s while it moves, UVA-DSA telesurgery QoS analysis 2026",
    )
    longest_wait: float = parameter(
        3.0,
        Within(0.1, 60.0, "s"),
        "after which it goes on, though its last motion did not show; less once it knows how late a motion shows",
        fixed=True,
        source="assumed: as the longest outage of the UVA-DSA telesurgery QoS analysis 2026",
    )
    fastest_turn: float = parameter(
        0.8, Within(0.05, 20.0, "rad/s"), "largest mean speed of a turn of the hand", fixed=True, source="assumed"
    )
    largest_turn: float = parameter(
        1.0,
        Within(0.1, 3.0, "rad"),
        "turn of the stylus at which the wrist ends",
        fixed=True,
        source="assumed: wrists turn by 1.3 rad to each side (Boone and Azen 1979), and nobody works at the end",
    )
    softness: float = parameter(
        0.003,
        Within(1e-5, 0.1, "m/N"),
        "way for a newton that it expects of what it presses first, before it has felt how soft that is",
        fixed=True,
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
