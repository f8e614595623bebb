"""What was tried of each block of code on the site, as a mark below the block.

``conf.py`` writes the marks, ``tests/scenario/test_documents.py`` keeps their word.
"""

import json
import re
from pathlib import Path

COMMAND = re.compile(r"^(?:\S*/)?teleop (.+)$", re.MULTILINE)
"""A line that calls ``teleop``, whatever folder the command stands in."""

RUN_BY_TESTS = "The tests run this."
CHECKED = "The tests check that these commands are valid."
NOT_RUN = "Not run when this site was built."

TAKEN = json.loads((Path(__file__).parent / "images" / "taken.json").read_text(encoding="utf-8"))
"""Version of teleop_core that each picture of the console shows; ``docs/pictures.py`` writes it."""


def mark_of(language: str, text: str) -> str:
    """Mark of a block; code cells need none, since their outputs follow them.

    Args:
        language: Language of a fenced block; empty for an indented one.
        text: The code.

    Returns:
        The sentence below the block; empty for what is no code to type.
    """
    if language == "python":
        return RUN_BY_TESTS
    if language in {"text", "output"}:
        return ""
    lines = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
    return CHECKED if all(COMMAND.match(line) for line in lines) else NOT_RUN


def taken_by(place: str) -> str:
    """Mark of a picture that is no output of this build; empty for all others.

    Args:
        place: Its path, from this folder.
    """
    version = TAKEN.get(Path(place).name)
    return f"Taken by docs/pictures.py of version {version}." if version else ""
