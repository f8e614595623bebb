"""Graph: stages, topics and links, the single description of what a session runs."""

from typing import TYPE_CHECKING

import lazy_loader

if TYPE_CHECKING:
    from teleop_core.graph import topics as topics
    from teleop_core.graph.graph import *  # noqa: F403
    from teleop_core.graph.layers import *  # noqa: F403
    from teleop_core.graph.noise import *  # noqa: F403
    from teleop_core.graph.row import *  # noqa: F403
    from teleop_core.graph.signals import *  # noqa: F403
    from teleop_core.graph.stage import *  # noqa: F403
else:  # loaded with their first use
    _NAMES = {
        "graph": ("BUILT_IN", "Graph", "HAND", "Member", "RECORDER_NAME", "build_graph"),
        "layers": ("Layer", "RealTimeParameters", "SESSION", "SessionParameters", "config_folder",
            "declared_groups"),
        "noise": ("Noise",),
        "row": ("Row",),
        "signals": ("DT", "STATE", "STATE_FIELDS", "TICK_NS", "assign", "copy", "make_signals"),
        "stage": ("STAGES", "Beside", "Runner", "RunningStage", "Stage", "register_stage"),
    }  # fmt: skip
    __getattr__, __dir__, __all__ = lazy_loader.attach(__name__, {"topics"}, _NAMES)
