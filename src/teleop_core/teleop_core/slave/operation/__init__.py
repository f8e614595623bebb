"""Operation: whether an arm may move, what stops it, and what is needed to move again."""

from teleop_core.slave.operation.faults import FAULTS, Fault, Reaction
from teleop_core.slave.operation.report import operation_level, operation_text
from teleop_core.slave.operation.states import Answer, Event, command_event
from teleop_core.slave.operation.thresholds import OperationParameters

__all__ = [
    "FAULTS", "Answer", "Event", "Fault", "OperationParameters", "Reaction",
    "command_event", "operation_level", "operation_text",
]  # fmt: skip
