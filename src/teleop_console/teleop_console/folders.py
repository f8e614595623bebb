"""Folders of the console: the only places whose files the form reads before a person at the page presses Start."""

from pathlib import Path

BAGS = Path("bags")
"""Folder of the recordings that are listed, and of new ones."""
ROBOTS = Path("robots")
"""Folder of the robot files that people drop on the form."""


def is_own(name: str) -> bool:
    """Whether a path is a recording, or a URDF that was dropped on the form; no symbolic link leads elsewhere."""
    path = Path(name)
    if path.name == ".." or not is_plain(path):
        return False
    is_robot = path.parent == ROBOTS and not ROBOTS.is_symlink() and path.suffix == ".urdf" and path.is_file()
    return is_robot or (path.parent == BAGS and path.is_dir())


def is_plain(path: Path) -> bool:
    """Whether a file or folder, and every file in that folder, is no symbolic link."""
    return not any(one.is_symlink() for one in (path, *(path.iterdir() if path.is_dir() else ())))
