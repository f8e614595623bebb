"""Own parts: Python files that register parts, for commands and for processes they start.

A package that is installed registers its parts by entry points; a single file is named once, by ``teleop --parts
FILE.py`` or in the environment variable ``TELEOP_PARTS``, and holds for every process of the session.
"""

import os
import sys
from collections.abc import Iterable
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from traceback import extract_tb

from teleop_core.base.errors import PartError, TeleopError

VARIABLE = "TELEOP_PARTS"


def load_own_parts(files: Iterable[Path] = ()) -> None:
    """Run the given files and those of the environment, each once, and pass them on to children.

    Raises:
        PartError: A file is missing or raises; the text names it and says what.
    """
    known = [Path(text) for text in os.environ.get(VARIABLE, "").split(os.pathsep) if text]
    wanted = list(dict.fromkeys(path.resolve() for path in (*known, *files)))
    for path in wanted:
        _load(path)
    if wanted:
        os.environ[VARIABLE] = os.pathsep.join(map(str, wanted))


def _load(path: Path) -> None:
    name = f"teleop_own_parts_{path.stem}"
    if name in sys.modules and getattr(sys.modules[name], "__file__", None) == str(path):
        return
    spec = spec_from_file_location(name, path)
    if not path.is_file() or spec is None or spec.loader is None:
        raise PartError("file of parts", str(path), "a Python file that exists")
    module = module_from_spec(spec)
    sys.modules[name] = module
    if str(path.parent) not in sys.path:  # as of any script, for what stands beside it
        sys.path.append(str(path.parent))
    try:
        spec.loader.exec_module(module)
    except TeleopError:
        del sys.modules[name]
        raise
    except Exception as error:  # whatever a user's file raises, one line names it
        del sys.modules[name]
        reason = " ".join(str(error).split())
        line = next((f.lineno for f in reversed(extract_tb(error.__traceback__)) if f.filename == str(path)), None)
        place = f" (line {line})" if line else ""
        text = f"a file that can be loaded; it raises {type(error).__name__}: {reason}{place}"
        raise PartError("file of parts", str(path), text) from error
