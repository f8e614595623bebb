"""Put your own network between both sides: a radio link that fades in and out."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import teleop_core as tc

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class FadingParameters:
    """Parameters for ``--set network.there.fading.period=...``; the draw gets them as numbers in their order."""

    period: float = tc.parameter(2.0, tc.Within(0.01, 60.0, "s"), "from fade to fade")
    worst: float = tc.parameter(0.9, tc.Within(0.0, 1.0), "share of packets lost in a fade")


@tc.kernel
def fading_draw(numbers: Array, memory: Array, chances: Array, now: float) -> float:
    """Lose a share of the packets that varies periodically between zero and the largest loss."""
    lost = 0.5 * numbers[1] * (1.0 - math.cos(2.0 * math.pi * now / numbers[0]))
    return -1.0 if chances[0] < lost else 0.0


tc.register_network(tc.Network("fading", FadingParameters, fading_draw))


def main() -> None:
    """Print the age of the received packets, and the share of lost packets."""
    for worst in (0.0, 0.5, 0.99):
        settings: dict[str, str | float] = {"network.there.kind": "fading", "network.there.fading.worst": worst}
        recording = tc.run("free_motion", duration=6.0, stages="network", settings=settings)
        score = recording.score()
        age, lost = (score.value(f"network.there.{key}") for key in ("age_p99_ms", "lost_share"))
        print(f"worst {worst:.2f}: {100.0 * (lost or 0.0):.0f} % lost, 99 % younger than {age:.0f} ms")


if __name__ == "__main__":
    main()
