"""Tables of docs/passivity.md and docs/network.md, from sessions in virtual time.

python docs/passivity_tables.py    prints them; docs/generate.py writes them into the pages
"""

import sys
from collections.abc import Iterator
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from teleop_core.coupling.passivity.port import DRIFT, IN, OUT, ROUND
from teleop_core.graph.topics import OPERATION
from teleop_core.kernels.geometry import Array
from teleop_core.session.configuration import configure
from teleop_core.session.virtual import VirtualTime

QUIET = ("feedback_timeout=1.0", "reach_force.is_on=false", "gimbal_noise=0.0")
BOTH, YIELDING = "[network,passivity]", "[network,impedance,passivity]"
MATERIALS = ("tissue", "silicone", "steel")
ROUND_TRIPS = (0, 100, 700)
"""Of the kinds [ms]."""
KINDS = ("none", "tank", "tdpa", "wave")
CHANNELS = (
    ("tissue", "position_force"), ("tissue", "four_channel"), ("silicone", "position_force"),
    ("silicone", "three_channel"), ("silicone", "four_channel"), ("steel", "position_force"),
    ("steel", "four_channel"),
)  # fmt: skip
"""Objects and architectures."""


def touch(kind: str, material: str, round_trip: float, *more: str, stages: str = BOTH) -> Any:
    """Signals of ``palpation``: 20 s, and the way there before them; a round trip in ms."""
    late = [f"network.{way}.least_delay={0.0005 * round_trip}" for way in ("there", "back")]
    settings = (
        f"teleop.stages={stages}", *QUIET, f"reflection.passivity={kind}",
        f"world.material={material}", *late, *more,
    )  # fmt: skip
    session = VirtualTime(configure("palpation", settings=settings))
    return session.run(session.lead + 20_000)


def fastest(rows: Any) -> float:
    """Fastest that the hand gets over 20 ms once it leads the slave [m/s]."""
    place = rows["master_measured_cp"][5000:, :3]
    return float(np.linalg.norm(place[20:] - place[:-20], axis=1).max() / 0.02)


def sizes(rows: Any, name: str) -> Array:
    """Sizes of a force [N] in every tick (N,)."""
    found: Array = np.linalg.norm(rows[name][:, :3], axis=1)
    return found


def rms(values: Array) -> float:
    """Root mean square of what is not zero."""
    felt = values[values > 0.0]
    return float(np.sqrt((felt * felt).mean())) if len(felt) else 0.0


def sums(rows: Any, column: int) -> float:
    """Energy of a column of both ports, over all rounds [J], as ``teleop evaluate`` adds it."""
    total = 0.0
    for name in ("master_energy", "slave_energy"):
        values, number = rows[name][:, column], rows[name][:, ROUND]
        grown = np.diff(values, prepend=0.0)
        is_new = np.diff(number, prepend=0.0) != 0.0
        total += float(np.where(is_new, values, grown).sum())
    return total


def created(rows: Any) -> float:
    """Most that came out of both true ports beyond what had gone in [J].

    At the hand the force that the device applied times the reading's way, at the slave true force
    and torque times true way and turn of the tip.
    """
    place, force, pose = (rows[name] for name in ("master_measured_cp", "slave_true_cf", "slave_true_cp"))
    given = np.einsum("ij,ij->i", rows["master_measured_cf"][1:, :3], np.diff(place[:, :3], axis=0))
    turn = Rotation.from_quat(pose[:, 3:], scalar_first=True)
    ways = np.hstack((np.diff(pose[:, :3], axis=0), (turn[1:] * turn[:-1].inv()).as_rotvec()))
    given -= np.einsum("ij,ij->i", 0.5 * (force[1:] + force[:-1]), ways)
    return float(np.cumsum(given).max(initial=0.0))


def table(head: str, rows: Iterator[tuple[str, ...]]) -> str:
    """A table in Markdown, of a first line and its rows."""
    lines = [head, "|" + "---|" * (head.count("|") - 1)]
    return "\n".join([*lines, *(f"| {' | '.join(cells)} |" for cells in rows)])


def wave_rows() -> Iterator[tuple[str, ...]]:
    """What waves cost."""
    for round_trip in (0, 200, 700):
        for material in MATERIALS:
            rows = touch("wave", material, round_trip)
            tip = sizes(rows, "slave_true_cf")
            drift = np.linalg.norm(rows["slave_energy"][:, DRIFT : DRIFT + 3], axis=1).max()
            yield (
                f"{round_trip} ms, {material}", f"{1e3 * fastest(rows):.0f} mm/s",
                f"{rms(sizes(rows, 'master_servo_cf')):.2f} N",
                f"{rms(tip):.2f}, {tip.max():.1f} N",
                f"{1e3 * sums(rows, IN):.0f}, {1e3 * sums(rows, OUT):.0f} mJ",
                f"{1e3 * drift:.1f} mm",
            )  # fmt: skip


def kind_rows() -> Iterator[tuple[str, ...]]:
    """What each kind makes of an object and a round trip."""
    for round_trip in ROUND_TRIPS:
        for material in MATERIALS:
            cells = [f"{round_trip} ms, {material}"]
            for kind in KINDS:
                rows = touch(kind, material, round_trip)
                cells.append(
                    f"{1e3 * fastest(rows):.0f} mm/s, {1e3 * created(rows):.1f} mJ, "
                    f"{rms(sizes(rows, 'master_measured_cf')):.2f} N, "
                    f"{sizes(rows, 'slave_true_cf').max():.1f} N"
                )
            yield tuple(cells)


def channel_rows() -> Iterator[tuple[str, ...]]:
    """Energy that is created over a round trip of 100 ms, by architecture."""
    for material, architecture in CHANNELS:
        cells = [f"{material}, `{architecture}`"]
        for kind in KINDS[:3]:
            stages = BOTH if architecture == "position_force" else YIELDING
            rows = touch(kind, material, 100, f"reflection.architecture={architecture}",
                         stages=stages)  # fmt: skip
            cells.append(f"{1e3 * created(rows):.1f} mJ")
        yield tuple(cells)


def touches(rows: Any) -> str:
    """How often the tip is pressed, breaks of 50 ms and less left out, and the hand's largest."""
    on = np.flatnonzero(sizes(rows, "slave_true_cf") > 0.05)
    times = int(len(on) > 0) + int(np.sum(np.diff(on) > 50))
    fault = rows["slave_operation"][:, OPERATION.index("fault")].any()
    return f"{times}, {sizes(rows, 'master_measured_cf').max():.1f} N{', fault' if fault else ''}"


def network_rows() -> Iterator[tuple[str, ...]]:
    """Touches over networks, without and with a tank."""
    for preset in ("none", "delay_100", "delay_500", "loss_50", "outages_1_of_1", "iss"):
        more = () if preset == "none" else (f"network.preset={preset}",)
        longer = (*more, "longest_outage=10.0")
        yield (
            f"`{preset}`" if more else preset,
            touches(touch("none", "tissue", 0, *longer, stages="[network]")),
            *(touches(touch(kind, "steel", 0, *longer, stages=stages))
              for kind, stages in (("none", "[network]"), ("tank", "[network]"), ("tank", BOTH))),
        )  # fmt: skip


def tables() -> dict[str, str]:
    """All tables by the name between whose markers they stand."""
    kinds = " | ".join(f"`{kind}`" for kind in KINDS)
    return {
        "waves": table(
            "| round trip, object | fastest hand | RMS at the hand | RMS, most on the tip "
            "| in, out | held back |", wave_rows(),
        ),
        "kinds": table(f"| round trip, object | {kinds} |", kind_rows()),
        "networks": table(
            "| network | tissue | steel | steel, `tank` | the same, with the stage `passivity` |",
            network_rows(),
        ),
        "channels": table("| object, architecture | `none` | `tank` | `tdpa` |", channel_rows()),
    }  # fmt: skip


if __name__ == "__main__":
    for text in tables().values():
        print(text, end="\n\n")
    sys.exit(0)
