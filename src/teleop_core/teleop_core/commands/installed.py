"""Commands of installed packages, which ``teleop`` finds through an entry-point group.

A package adds a command by a function that adds its parser, like ``add`` in the modules of this folder::

    [project.entry-points."teleop_core.commands"]
    polish = "my_package.commands.polish:add"
"""

import sys
from typing import Any

from teleop_core.base.texts import one_line

GROUP = "teleop_core.commands"
RELEASED_TOGETHER = {
    "console": "teleop_console",
    **dict.fromkeys(("export", "import"), "teleop_exchange"),
    **dict.fromkeys(("calibrate", "experiment", "fit", "reach"), "teleop_lab"),
    **dict.fromkeys(("conformance", "drill"), "teleop_drill"),
}
"""Commands of the other distributions of this project, each with its distribution."""


def add(commands: Any) -> None:
    """Add the parsers of installed commands. A command that cannot be loaded is reported and left out."""
    from importlib.metadata import entry_points

    for entry in sorted(entry_points(group=GROUP), key=lambda entry: entry.name):
        if entry.name in commands.choices:
            continue
        try:
            entry.load()(commands)
        except Exception as error:  # any exception of a foreign module becomes one line that names the module
            reason = one_line(f"{type(error).__name__}: {error}")
            print(f"note: no command {entry.name}, from {entry.value}: {reason}", file=sys.stderr)


def advice(name: str) -> str | None:
    """Advice which distribution to install for a missing command of this project; None for any other word."""
    distribution = RELEASED_TOGETHER.get(name)
    return distribution and f"install {distribution}, which has this command"
