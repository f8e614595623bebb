"""Report of an arm's operation, from the numbers of ``slave/operation``."""

from collections.abc import Mapping

from teleop_core.graph.operation import State
from teleop_core.slave.operation.faults import FAULTS, Fault


def operation_text(values: Mapping[str, float], joint_names: tuple[str, ...] = ()) -> str:
    """State in words: ``"ENABLED, homed"`` or ``"FAULT: emergency stop; reset, then enable"``.

    Args:
        values: Numbers of :data:`~teleop_core.graph.topics.OPERATION` by name.
        joint_names: Names of the joints; without names, joints are numbered from 1.
    """
    state = State(int(values["state"]))
    is_waiting = state is State.ENABLED and not values["is_homed"]
    homed = "homed" if values["is_homed"] else f"not homed{'; home next' if is_waiting else ''}"
    doing = "moving to its goal" if values["is_busy"] else homed
    text = f"{state.name}, {doing}"
    fault = Fault(int(values["fault"]))
    if fault is Fault.NONE:
        return text
    reason = fault_text(fault, values, joint_names)
    release = "release the stop, " if values["is_pressed"] else ""
    home = ", then home" if not values["is_homed"] else ""
    cure = {State.FAULT: f"; {release}reset, then enable{home}", State.PAUSED: "; resume to go on"}.get(state, "")
    return f"{text}: {reason}{cure}"


def operation_level(values: Mapping[str, float]) -> int:
    """Level of the report: 2, an error, in FAULT; 1, a warning, with another fault; else 0."""
    if values["fault"] == 0.0:
        return 0
    return 2 if values["state"] == State.FAULT else 1


def fault_text(fault: Fault, values: Mapping[str, float], joint_names: tuple[str, ...] = ()) -> str:
    """Fault in words, with joint, value and bound if the fault has them."""
    kind, joint = FAULTS[fault], int(values["fault_joint"])
    text = kind.text
    if joint >= 0:
        text += f" ({joint_names[joint] if joint < len(joint_names) else f'joint {joint + 1}'})"
    if values["fault_bound"] > 0.0:
        text += f": {values['fault_value']:.3g}, at most {values['fault_bound']:.3g} {kind.unit}"
    return text
