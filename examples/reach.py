"""Compute how much of a large hand motion a slave can follow, and let the slave follow it."""

import teleop_core as tc
import teleop_lab as lab


def main() -> None:
    """Print the share of the time in which the slave follows, with the given and the proposed settings."""
    hand = tc.run(
        duration=30.0,
        robot="rcrt1",
        operator="random",
        operator__size=(0.25, 0.25, 0.2),
        operator__rotation=1.2,
        operator__period=6.0,
        reach_force__is_on=False,  # no force must hold back the hand
    )
    reach = lab.reach(hand)
    print(reach)
    for name, settings in (("as given", {}), ("proposed", reach.settings())):
        told = tc.replay(hand, settings=settings)["slave/reach"]
        print(f"{name}: {(told['limit'] == 0.0).mean():.1%} followed in a session")


if __name__ == "__main__":
    main()
