"""Slow contacts with a damped wall: the most that they give back of what they took.

``python benchmarks/walls.py`` prints the table of docs/device_and_walls.md. The hand is that of
``tests/property/test_contact_laws.py``, with the tremor of the person simulated. *Press*: it goes
4 mm into one wall and out again at 0.13 Hz. *Slide*: along and into the walls of a box. Contacts
of less than a touch do not count.
"""

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "tests" / "support"))
from property.test_contact_laws import HALF, energies, session, slow  # noqa: E402
from teleop_core.evaluation.metrics.contact import TOUCH_J  # noqa: E402
from teleop_core.kernels.geometry import Array  # noqa: E402

ROWS = (
    (300.0, 10.0, 0), (300.0, 10.0, 1), (300.0, 10.0, 3), (500.0, 10.0, 0), (500.0, 10.0, 1),
    (1000.0, 10.0, 0), (1000.0, 10.0, 1), (1000.0, 20.0, 0), (1000.0, 20.0, 1),
    (1260.0, 10.0, 0), (2000.0, 20.0, 0), (2310.0, 10.0, 0), (5000.0, 10.0, 1),
)  # fmt: skip
"""Stiffness [N/m], damping [N·s/m], delay [ms]."""
SECONDS = 24.0


def press(times: Array) -> Array:
    """Into the wall in x and out again."""
    wave = (HALF + 4e-3) * np.sin(2.0 * np.pi * 0.13 * times)
    return wave[:, None] * (1.0, 0.0, 0.0)


def share(motion: Callable[[Array], Array], stiffness: float, damping: float, delay: int) -> str:
    """Largest share [%] that a contact gave back."""
    found = session(motion, SECONDS, delay=delay, stiffness=stiffness, damping=damping)
    taken, returned, _ = energies(*found).T
    counts = np.maximum(taken, returned) >= TOUCH_J
    if not counts.any():
        return "–"
    most = 100.0 * float((returned / np.maximum(taken, 1e-12))[counts].max())
    return f"**{most:.0f} %**" if most > 100.0 else f"{most:.0f} %"


def main() -> None:
    """Print the table."""
    print("| stiffness, damping, delay beyond the tick | press | slide |")
    print("|---|---|---|")
    for row in ROWS:
        cells = " | ".join(share(motion, *row) for motion in (press, slow))
        print(f"| {row[0]:g} N/m, {row[1]:g} N·s/m, {row[2]} ms | {cells} |")


if __name__ == "__main__":
    main()
