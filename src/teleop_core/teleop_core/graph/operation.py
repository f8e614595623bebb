"""Operation: the operating states of an arm, as ``slave/operation`` reports them and all stages know them."""

from enum import IntEnum


class State(IntEnum):
    """Operating state of an arm; it moves in ENABLED only."""

    DISABLED = 0
    ENABLED = 1
    PAUSED = 2
    FAULT = 3
