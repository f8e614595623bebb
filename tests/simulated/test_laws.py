"""Laws in schedules that no random one of the first thousands has."""

from teleop_core.slave.operation.states import COMMANDS
from teleop_drill.simulation.schedules import Fault
from teleop_drill.simulation.seeds import run_seed

_NAMES = sorted((*COMMANDS, "release"))
HOME = (_NAMES.index("home") + 0.5) / len(_NAMES)


def test_a_stop_in_the_middle_of_a_move_leaves_nothing_to_go_on_with() -> None:
    faults = (Fault(1.0, "command", "", 0.1, HOME), Fault(1.15, "press", "", 0.5, 0.5))
    found = run_seed(0, faults)
    assert not found.broken
    assert found.met["press", "ENABLED"] == 1
