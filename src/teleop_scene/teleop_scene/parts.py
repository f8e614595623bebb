"""Parts that this distribution adds: the reader of scenes, the plant and the stage ``scene``.

Every process that reads a configuration imports them. MuJoCo takes 23 MB and 0.1 s of processor time, so it is imported
only when a scene is loaded.
"""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from teleop_core.base import NoParameters
from teleop_core.graph import DT, Beside, RunningStage, Stage, topics
from teleop_core.robots.robot import Robot
from teleop_core.slave.arm import ArmParts
from teleop_core.slave.plants import PLANTS, Physics, Plant
from teleop_scene.parameters import SceneParameters, View

if TYPE_CHECKING:
    from teleop_scene.plant import Mover


class Reader:
    """Loads the arm of a scene, see :func:`teleop_scene.arm.load_scene`, and finds the files of the scene."""

    name = "scene"

    def file(self, name: str) -> Path:
        """File that the name of a scene means."""
        from teleop_scene import models

        return models.file_of(name)

    def load(self, file: Path, *, tip: str = "", base: str = "", task: str = "", drive: str = "model") -> Robot:
        """Arm of a scene, as a robot."""
        from teleop_scene import arm

        return arm.load_scene(file, tip=tip, base=base, task=task, drive=drive)

    def files(self, file: Path) -> dict[str, Path]:
        """All files of a scene by their paths from the folder that contains all of them; the scene comes first."""
        from teleop_scene import models

        return models.files_of(file)


READER = Reader()
"""Reader of scenes for ``robot=SCENE.xml``."""


def _physics(_parameters: NoParameters, robot: Robot) -> Physics:
    """Numbers of an ideal arm, which serve the checks of the control loop."""
    found: Physics = PLANTS.find("ideal").physics(NoParameters(), robot)
    return found


def _mover(_parameters: NoParameters, robot: Robot, arm: ArmParts, row: Any, dt: float) -> "Mover":
    from teleop_scene.plant import mover

    return mover(robot, arm, row, dt)


SCENE = Plant("scene", NoParameters, _physics, _mover)


def cameras_beside(p: SceneParameters) -> Beside | None:
    """Process that films a live session; None without cameras."""
    if not p.cameras:
        return None
    views = [View.parse(camera) for camera in p.cameras]
    words = ("camera", p.robot, *p.cameras, "--rate", str(p.camera_rate))
    return Beside(words, tuple(name for view in views for name in (view.topic, view.info_topic)))


def _stage(parameters: SceneParameters, dt: float = DT) -> RunningStage:
    from teleop_scene.bodies import SceneBodies

    return SceneBodies(SCENE_STAGE, parameters, dt)


SCENE_STAGE = Stage(
    "scene",
    SceneParameters,
    reads=(topics.SLAVE_MEASURED_JS, topics.SLAVE_JAW_SETPOINT_JS),
    writes=(topics.SCENE_POSES, topics.SCENE_ENERGY, topics.SLAVE_JAW_MEASURED_JS),
    optional=(topics.SLAVE_JAW_SETPOINT_JS,),
    on_demand=(topics.SLAVE_JAW_MEASURED_JS,),
    beside=cameras_beside,
    make=_stage,
)
