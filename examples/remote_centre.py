"""Let the tool pass through a port; measure how far its shaft misses the port, with and without a remote centre."""

import teleop_core as tc


def main() -> None:
    """Print the distance of the shaft from two centres, and the lag of the tip."""
    free = tc.run("coarse_box", duration=10.0)
    error = free.score().position_error_mm
    print(f"free: tip {error.rms:.2f} mm from its setpoint")
    for depth in (0.1, 0.05):
        kept = tc.run(
            "coarse_box", duration=10.0, stages="remote_centre",
            settings={"remote_centre.depth": depth},
        )  # fmt: skip
        score = kept.score()
        off, most = (score.value(f"remote_centre.{key}_mm") for key in ("off_rms", "off_max"))
        print(
            f"{1e3 * depth:.0f} mm deep: shaft {off or 0.0:.2f} mm from the centre, "
            f"{most or 0.0:.2f} at most; tip {score.position_error_mm.rms:.2f} mm from its setpoint"
        )


if __name__ == "__main__":
    main()
