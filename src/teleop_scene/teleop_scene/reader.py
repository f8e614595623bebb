"""Reader of scenes for ``robot=SCENE.xml``."""

from pathlib import Path

from teleop_core.robots.robot import Robot
from teleop_scene import arm, models


class Reader:
    """Loads the arm of a scene, see :func:`teleop_scene.arm.load_scene`, and finds the files of the scene."""

    name = "scene"

    def file(self, name: str) -> Path:
        """File that the name of a scene means."""
        return models.file_of(name)

    def load(self, file: Path, *, tip: str = "", base: str = "", task: str = "", drive: str = "model") -> Robot:
        """Arm of a scene, as a robot."""
        return arm.load_scene(file, tip=tip, base=base, task=task, drive=drive)

    def files(self, file: Path) -> dict[str, Path]:
        """All files of a scene by their paths from the folder that contains all of them; the scene comes first."""
        return models.files_of(file)


READER = Reader()
