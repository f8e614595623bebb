"""Compare the motion of simulated hands, `human` and the smooth `random`, with that of people."""

import numpy as np

import teleop_core as tc

SEEDS = (1, 2, 3)
# Smallest and largest values of surgeons at a da Vinci (JIGSAWS) and of another user of a da Vinci.
# Median speed: from medians per task of 46 tracks of JIGSAWS to the hand that the UVA-DSA
# telesurgery QoS analysis 2026 ships, while it moves.
PEOPLE = {
    "speed_median_mm_s": (9.0, 20.0),
    "speed_p95_mm_s": (48.0, 101.0),
    "frequency_50_hz": (0.6, 1.05),
    "frequency_95_hz": (2.1, 7.3),
    "power_1_3": (0.27, 0.53),
    "peaks_per_s": (1.3, 2.8),
    "idle_share": (0.14, 0.27),
    "sparc": (-3.8, -3.3),
    "acceleration_p95_m_s2": (0.35, 0.75),
    "tremor_um": (63.0, 63.0),
}


def measured(operator: str) -> dict[str, list[float | None]]:
    """Figures of the hand in a minute of free motion, per seed."""
    found: dict[str, list[float | None]] = {name: [] for name in PEOPLE}
    for seed in SEEDS:
        score = tc.run("human", operator=operator, seed=seed).score()
        for name, values in found.items():
            values.append(score.value(f"motion.hand.{name}"))
    return found


def main() -> None:
    """Print a table with the figures of people and of the operators."""
    table = {operator: measured(operator) for operator in ("human", "random")}
    print(f"{'':24}{'people':>18}{'human':>18}{'random':>18}")
    for name, (low, high) in PEOPLE.items():
        cells = [f"{low:g} … {high:g}" if low < high else f"{low:g}"]
        for operator in table.values():
            values = np.array(operator[name], float)
            cells.append(f"{values.min():.3g} … {values.max():.3g}")
        print(f"{name:24}" + "".join(f"{cell:>18}" for cell in cells))


if __name__ == "__main__":
    main()
