"""Pick up a block with the jaw, carry it, and set it down; slippery fingers lose it."""

import teleop_core as tc


def main() -> None:
    """Print the final position of the block and the counts of the jaw, for three frictions of the fingers."""
    for friction in (0.5, 0.065, 0.05):
        picked = tc.run("pick", settings={"jaw_sim.object.friction": friction})
        score, block = picked.score(), picked["slave/jaw/object_cp"]
        way = 1e3 * (block["y"][0] - block["y"][-1])
        rise = 1e3 * (block["z"].max() - block["z"][0])
        force = score.value("jaw.peak_force_n") or 0.0
        print(
            f"friction {friction:g}: lifted {rise:.0f} mm, carried {way:.1f} mm; "
            f"{score.value('jaw.slips')} slips, {score.value('jaw.drops')} drops, "
            f"{force:.2f} N at most"
        )


if __name__ == "__main__":
    main()
