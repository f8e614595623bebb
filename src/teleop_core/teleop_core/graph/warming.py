"""Warming: the first step of a stage is made and undone before the ticks of the session begin."""

from teleop_core.graph.signals import assign
from teleop_core.graph.stage import Runner
from teleop_core.kernels import is_kernel


def warm_up(runner: Runner) -> None:
    """Load a stage and leave it in its initial state, so that its first step takes no longer than others.

    A compiled step is made and undone, which loads its code and memory. Random numbers and motion are prepared in
    advance. Steps that are not compiled are not made, because their effects may be impossible to undo.

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
    runner.load()  # a reset stage may have other arguments
    if runner.ahead > 1:  # an operator that reacts to each tick must draw with the values of that tick
        runner.prepare(1)
