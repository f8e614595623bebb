"""Approach: the smooth move of the hand to where its task begins, which figures of motion leave."""

from teleop_core.errors import TeleopError
from teleop_core.evaluation.context import Context
from teleop_core.operators import OPERATORS
from teleop_core.operators.parameters import OperatorParameters
from teleop_core.parameters import build
from teleop_core.signals import STATE


def approach_end_ns(context: Context) -> int:
    """Time at which the approach is over [ns].

    The approach begins when teleop/state first says that the slave follows, and takes as long as
    the stored configuration says. Recordings of others have none, and begin at once.
    """
    history, start_ns = context.history, context.bag.start_ns
    begin_ns = start_ns
    follows = history.stamp_ns[history.rows[:, STATE["is_following"]] > 0.0]
    if len(follows):
        begin_ns = max(start_ns, int(follows[0]))
    return begin_ns + round(approach_time(context) * 1e9)


def approach_time(context: Context) -> float:
    """How long the operator approached the centre of its motion [s]; 0 if nothing is known."""
    values = context.origin.operator
    try:
        common = build(OperatorParameters, values, "operator.")
        operator = OPERATORS.find(common.kind.kind)
    except TeleopError:
        return 0.0
    # A recorded motion is approached where it has been moved to a centre.
    is_moved = operator.length is not None and any(common.center)
    return common.approach_time if values and (operator.approaches or is_moved) else 0.0
