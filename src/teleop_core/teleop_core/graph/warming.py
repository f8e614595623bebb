"""Warming: the first step of a stage, made and taken back before its ticks begin."""

from teleop_core.graph.signals import assign
from teleop_core.graph.stage import Runner
from teleop_core.kernels import is_kernel


def warm_up(runner: Runner) -> None:
    """Load a stage, and leave it as it was made: its first step takes no longer than others.

    A compiled step is made and taken back, which touches its code and memory. What is drawn ahead
    is drawn. Other steps are not made, for they may do what cannot be taken back.

    Args:
        runner: The stage, before its first step.
    """
    runner.load()
    if not is_kernel(runner.kernel):
        return
    before = runner.signals.copy()
    runner.step()
    runner.reset()
    assign(runner.signals, before)
    runner.load()  # what was reset may have other arguments
    if runner.ahead > 1:  # who answers to each tick is to draw with what that one brings
        runner.prepare(1)
