from .graph import topics as topics
from .session.api import configuration as configuration, replay as replay, run as run
from .slave.controllers import Controller as Controller, register_controller as register_controller
from .base.errors import (
    ClosureError as ClosureError,
    EvaluationError as EvaluationError,
    KernelError as KernelError,
    ParameterError as ParameterError,
    PartError as PartError,
    RecordingError as RecordingError,
    SessionError as SessionError,
    ShapeError as ShapeError,
    TeleopError as TeleopError,
    TeleopWarning as TeleopWarning,
    UnknownNameError as UnknownNameError,
)
from .evaluation import (
    Key as Key,
    Metric as Metric,
    Score as Score,
    frame_of as frame_of,
    register_metric as register_metric,
)
from .coupling.passivity import Passivity as Passivity, register_passivity as register_passivity
from .coupling.architectures import Architecture as Architecture, register_architecture as register_architecture
from .coupling.filters import TremorFilter as TremorFilter, register_tremor_filter as register_tremor_filter
from .graph.graph import Graph as Graph, build_graph as build_graph
from .kernels import kernel as kernel
from .kernels.fields import Fields as Fields, Vector3 as Vector3
from .coupling.network import Network as Network, register_network as register_network
from .hand.operators import (
    Operator as Operator,
    Seen as Seen,
    Setting as Setting,
    following as following,
    register_operator as register_operator,
)
from .hand.operators.policy import View as View, register_policy as register_policy
from .hand.operators.remote import RemoteHand as RemoteHand, remote_operator as remote_operator
from .hand.tasks import Task as Task, register_task as register_task
from .base.parameters import NoParameters as NoParameters, Within as Within, parameter as parameter
from .slave.bridges import Bridge as Bridge, Command as Command, register_bridge as register_bridge
from .shapes import Shape as Shape, register_shape as register_shape
from .slave.plants import Physics as Physics, Plant as Plant, register_plant as register_plant
from .session.recording import Recording as Recording, Stream as Stream, open_recording as open_recording
from .robots import (
    Robot as Robot,
    list_robots as list_robots,
    load_robot as load_robot,
    register_robot as register_robot,
    robot_from_table as robot_from_table,
)
from .robots.selection import RobotParameters as RobotParameters
from .session.configuration import Configuration as Configuration
from .session.stepped import Observation as Observation, Session as Session, Space as Space
from .session.virtual import VirtualTime as VirtualTime
from .graph.row import Row as Row
from .graph.stage import Runner as Runner, Stage as Stage, register_stage as register_stage
from .graph.topics import Kind as Kind, Topic as Topic

__version__: str
