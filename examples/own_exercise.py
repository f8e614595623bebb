"""Inject your own fault into a session: an exercise of the drill, in one file.

Run this file, or add the exercise to the command: ``teleop --parts examples/own_exercise.py drill shaken``.
"""

import math
import sys
import tempfile
from pathlib import Path

from teleop_core.graph.operation import State
from teleop_drill import AllowedMotion, Cure, Exercise, Rig, hand, register_exercise

AMPLITUDE, FREQUENCY = 0.0003, 10.0  # m, Hz


def shake(rig: Rig) -> None:
    """Let the hand oscillate across its path for a second, like a trembling hand."""
    rig.mark()  # the fault begins
    rig.distort(hand.shaken(AMPLITUDE, FREQUENCY))
    rig.wait(1.0)


def steady(rig: Rig) -> None:
    """End the oscillation."""
    rig.distort(hand.faithful)


SHAKEN = register_exercise(
    Exercise(
        name="shaken",
        text="hand trembles by 0.3 mm, ten times a second",
        inject=shake,
        undo=steady,
        motion=AllowedMotion.GOES_ON,
        states=(State.ENABLED,),
        cures=(Cure.NOTHING,),
        hand_speed=math.hypot(hand.SPEED, 2.0 * math.pi * FREQUENCY * AMPLITUDE),
    )
)


def main() -> int:
    """Run the exercise in its own session; return 0 if the arm reacted as expected."""
    from teleop_drill.nodes.drill import drill  # needs ROS

    with tempfile.TemporaryDirectory() as folder:
        (outcome,) = drill([SHAKEN], Path(folder) / "drill", print, is_composed=True)
    print(f"went {1e3 * outcome.measured('path_m').value:.0f} mm, {outcome.state_text}")
    print("\n".join(outcome.failures()))  # missing messages of the recording are known only at the end
    return len(outcome.failures())


if __name__ == "__main__":
    sys.exit(main())
