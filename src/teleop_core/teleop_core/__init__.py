"""Master-slave teleoperation: haptic master, motion scaling, inverse kinematics, 1 kHz slave.

Folders follow the data: ``operators`` -> ``master`` -> ``mapping`` and ``fixtures`` -> ``robots``
-> ``slave``, ``controllers`` and ``plants`` -> ``bags`` -> ``evaluation``. ``graph`` says which
stages there are and how they are linked, ``session`` runs them in virtual time, ``nodes`` puts
them on ROS 2 topics.

Everything a user needs is here:

- :func:`run`, :func:`replay`, :func:`open_recording`: sessions and what was recorded of them;
- :func:`import_recording`, :func:`export_recording`: recordings of others, and ours for others;
- :func:`configuration`: what a session runs, checked;
- :func:`load_robot`, :func:`list_robots`, :func:`robot_from_table`: arms;
- :func:`fit_plant`, ``teleop_core.calibration``, ``teleop_core.experiments``: what a real arm does;
- :class:`Stage`, :class:`Fixture`, :class:`Controller`, :class:`Plant`, :class:`Operator`,
  :class:`Metric` and the ``register_...`` functions: parts of your own;
- :func:`kernel`, :func:`parameter`, ``topics``: what parts are made of.
"""

from importlib import import_module
from typing import TYPE_CHECKING

__version__ = "0.6.0"

if TYPE_CHECKING:
    from teleop_core import topics
    from teleop_core.api import configuration, replay, run
    from teleop_core.controllers import Controller, register_controller
    from teleop_core.errors import (
        ClosureError,
        EvaluationError,
        KernelError,
        ParameterError,
        PartError,
        RecordingError,
        SessionError,
        ShapeError,
        TeleopError,
        UnknownNameError,
    )
    from teleop_core.evaluation import Key, Metric, Score, frame_of, register_metric
    from teleop_core.exchange import (
        ExportReport,
        ImportOptions,
        ImportReport,
        export_recording,
        import_recording,
    )
    from teleop_core.fitting import FitError, FitResult, fit_plant
    from teleop_core.fixtures import Fixture, register_fixture
    from teleop_core.graph import Graph, build_graph
    from teleop_core.kernels import kernel
    from teleop_core.operators import Operator, following, register_operator
    from teleop_core.operators.remote import RemoteHand, remote_operator
    from teleop_core.parameters import NoParameters, parameter
    from teleop_core.planning.reach import Reach, reach
    from teleop_core.plants import Physics, Plant, register_plant
    from teleop_core.recording import Recording, Stream, open_recording
    from teleop_core.robots import (
        Robot,
        list_robots,
        load_robot,
        register_robot,
        robot_from_table,
    )
    from teleop_core.robots.parameters import RobotParameters
    from teleop_core.stage import Stage, register_stage
    from teleop_core.topics import Kind, Topic

_PLACES = {
    "api": ("configuration", "replay", "run"),
    "controllers": ("Controller", "register_controller"),
    "errors": (
        "ClosureError",
        "EvaluationError",
        "KernelError",
        "ParameterError",
        "PartError",
        "RecordingError",
        "SessionError",
        "ShapeError",
        "TeleopError",
        "UnknownNameError",
    ),
    "evaluation": ("Key", "Metric", "Score", "frame_of", "register_metric"),
    "exchange": (
        "ExportReport",
        "ImportOptions",
        "ImportReport",
        "export_recording",
        "import_recording",
    ),
    "fitting": ("FitError", "FitResult", "fit_plant"),
    "fixtures": ("Fixture", "register_fixture"),
    "graph": ("Graph", "build_graph"),
    "kernels": ("kernel",),
    "operators": ("Operator", "following", "register_operator"),
    "operators.remote": ("RemoteHand", "remote_operator"),
    "parameters": ("NoParameters", "parameter"),
    "planning.reach": ("Reach", "reach"),
    "plants": ("Physics", "Plant", "register_plant"),
    "recording": ("Recording", "Stream", "open_recording"),
    "robots": ("Robot", "list_robots", "load_robot", "register_robot", "robot_from_table"),
    "robots.parameters": ("RobotParameters",),
    "stage": ("Stage", "register_stage"),
    "topics": ("Kind", "Topic"),
}
_HOME = {name: module for module, names in _PLACES.items() for name in names}

__all__ = [
    "ClosureError",
    "Controller",
    "EvaluationError",
    "ExportReport",
    "FitError",
    "FitResult",
    "Fixture",
    "Graph",
    "ImportOptions",
    "ImportReport",
    "KernelError",
    "Key",
    "Kind",
    "Metric",
    "NoParameters",
    "Operator",
    "ParameterError",
    "PartError",
    "Physics",
    "Plant",
    "Reach",
    "Recording",
    "RecordingError",
    "RemoteHand",
    "Robot",
    "RobotParameters",
    "Score",
    "SessionError",
    "ShapeError",
    "Stage",
    "Stream",
    "TeleopError",
    "Topic",
    "UnknownNameError",
    "__version__",
    "build_graph",
    "configuration",
    "export_recording",
    "fit_plant",
    "following",
    "frame_of",
    "import_recording",
    "kernel",
    "list_robots",
    "load_robot",
    "open_recording",
    "parameter",
    "reach",
    "register_controller",
    "register_fixture",
    "register_metric",
    "register_operator",
    "register_plant",
    "register_robot",
    "register_stage",
    "remote_operator",
    "replay",
    "robot_from_table",
    "run",
    "topics",
]


def __getattr__(name: str) -> object:
    """Load a name on first use, so that importing the package stays cheap."""
    if name == "topics":
        return import_module("teleop_core.topics")
    if name in _HOME:
        return getattr(import_module(f"teleop_core.{_HOME[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
