"""Parameters of the operator ``observer``: how it sees, waits, moves and turns."""

from dataclasses import dataclass

from teleop_core.base import Within, fixed
from teleop_core.kernels.axes import AXES

_FITTED = "fitted: to times and misses of MacKenzie and Ware 1993"


@dataclass(frozen=True, kw_only=True)
class ObserverParameters:
    """How the operator sees, waits and moves."""

    eye: float = fixed(
        0.11,
        Within(0.0, 1.0, "s"),
        "time from seeing or feeling something to a plan that uses it",
        source="published: 0.110 to 0.163 s in six studies of corrections by sight",
    )
    reaction: float = fixed(
        0.03,
        Within(0.0, 2.0, "s"),
        "time from a new goal, whose place is expected, to the first submovement",
        source=_FITTED,
    )
    least_time: float = fixed(0.102, Within(0.02, 1.0, "s"), "shortest duration of a submovement", source=_FITTED)
    undershoot: float = fixed(
        0.315,
        Within(0.0, 0.9),
        "share of the distance to the goal that a submovement leaves on purpose",
        source=_FITTED,
    )
    noise: float = fixed(
        0.0194,
        Within(0.0, 0.5, "s"),
        "standard deviation of a submovement's end along its direction, divided by its mean speed",
        source=_FITTED + "; linear in speed: Meyer et al. 1988",
    )
    noise_across: float = fixed(
        0.36,
        Within(0.0, 1.0),
        "standard deviation of a submovement's end across its direction, divided by that along it",
        source="assumed: the ratio of the operator human",
    )
    error_cost: float = fixed(
        0.87,
        Within(0.01, 1000.0, "s"),
        "cost of an error, as time: the operator presses, grips or releases when the believed probability of an error "
        "times this cost is less than the time of another look",
        source=_FITTED,
    )
    fastest: float = fixed(
        0.04,
        Within(0.005, 10.0, "m/s"),
        "largest mean speed of a submovement of the hand; the peak speed is 1.9 times as high",
        source="fitted: to 65 mm/s, the 95th percentile of the moving hand's speed, UVA-DSA telesurgery "
        "QoS analysis 2026",
    )
    longest_wait: float = fixed(
        3.0,
        Within(0.1, 60.0, "s"),
        "longest wait until the display shows the last motion; then the operator goes on. It waits "
        "less once it knows the delay of the display",
        source="assumed: as the longest outage of the UVA-DSA telesurgery QoS analysis 2026",
    )
    fastest_turn: float = fixed(
        0.8, Within(0.05, 20.0, "rad/s"), "largest mean angular speed of a turn of the hand", source="assumed"
    )
    largest_turn: float = fixed(
        1.0,
        Within(0.1, 3.0, "rad"),
        "largest turn of the stylus that the wrist can make",
        source="assumed: wrists turn by 1.3 rad to each side (Boone and Azen 1979), and nobody works at that limit",
    )
    softness: float = fixed(
        0.003,
        Within(1e-5, 0.1, "m/N"),
        "compliance that the operator expects of an object before it has pressed it",
        source="assumed: the same as task.palpate.yielding",
    )
    axes: tuple[str, ...] = fixed(
        ("-z", "-x", "+y"), length=3, doc="axes of the hand along x, y, z of the slave; the same as motion_scaling.axes"
    )
    tool_axes: tuple[str, ...] = fixed(
        (),
        choices=AXES,
        doc="axes of the stylus along x, y, z of an aligned tool: motion_scaling.tool_axes after its tool_roll; empty, "
        "as there, if the tool turns about the axes of the hand's turn; rcrt1 has -y, -x, -z",
    )
