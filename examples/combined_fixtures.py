"""Keep the hand, or also the slave, inside shapes that are combined from other shapes."""

import teleop_core as tc

SHAPES: dict[str, tuple[str, ...]] = {
    "union": ("sphere radius=0.015", "cylinder radius=0.005 length=0.06 at=[0, 0.02, 0]"),
    "intersection": ("box size=[0.03, 0.03, 0.03]", "not sphere at=[0, 0.02, 0] radius=0.01"),
}


def main() -> None:
    """Print how far the slave leaves each shape, for fixtures that act on the hand, on the slave, or on both."""
    for kind, parts in SHAPES.items():
        for side in ("hand", "both"):
            settings = {"fixture": kind, f"fixture.{kind}.parts": parts, "fixture.side": side}
            score = tc.run("coarse_box", duration=12.0, settings=settings).score()
            outside = score.value("fixture.penetration_max_mm")
            push = score.value("force_n.max")
            print(f"{kind:13}{side:5} slave {outside:.2f} mm outside at most, push {push:.2f} N")


if __name__ == "__main__":
    main()
