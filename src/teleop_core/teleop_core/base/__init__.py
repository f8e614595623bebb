"""Base: errors, texts, parameters and registries, which all other modules use."""

from typing import TYPE_CHECKING

import lazy_loader

if TYPE_CHECKING:
    from teleop_core.base.damage import *  # noqa: F403
    from teleop_core.base.errors import *  # noqa: F403
    from teleop_core.base.parameters import *  # noqa: F403
    from teleop_core.base.registry import *  # noqa: F403
    from teleop_core.base.texts import *  # noqa: F403
else:  # imported at the first use
    _NAMES = {
        "errors": ("ClosureError", "EvaluationError", "KernelError", "ParameterError", "PartError", "RecordingError",
            "SessionError", "ShapeError", "TeleopError", "TeleopWarning", "UnknownNameError"),
        "damage": ("damage_told",),
        "parameters": ("Choice", "NoParameters", "Spec", "Value", "Within", "build", "choice", "fill", "fixed",
            "parameter", "specs", "values_of"),
        "registry": ("Registry", "part_check"),
        "texts": ("one_line", "printable", "shown"),
    }  # fmt: skip
    __getattr__, __dir__, __all__ = lazy_loader.attach(__name__, None, _NAMES)
