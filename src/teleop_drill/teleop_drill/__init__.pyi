from . import conformance as conformance
from .drill import (
    EXERCISES as EXERCISES,
    SHORT as SHORT,
    Cure as Cure,
    Exercise as Exercise,
    Master as Master,
    AllowedMotion as AllowedMotion,
    FaultOutcome as FaultOutcome,
    Rig as Rig,
    chosen as chosen,
    hand as hand,
    register_exercise as register_exercise,
)

__version__: str
