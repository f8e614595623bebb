"""Process that expands a xacro: ``python -m teleop_core.robots.files.xacro_process FILE ARGUMENTS`` prints JSON.

The answer has the entry ``xml``, or those of an error.
"""

import json
import re
import resource
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path

from teleop_core.base import ParameterError, TeleopError, UnknownNameError
from teleop_core.robots.files import urdf_tree, visuals

MEMORY = 2 << 30
"""Largest memory of the process [bytes]."""
_DECLARED = re.compile(r"<xacro:arg\s[^>]*?name=[\"']([^\"']+)")
_MOST_CHARACTERS = 300  # characters kept of the package's message, which may be pages long
_LOADED = (".yaml", ".yml", ".json")


def answer(path: Path, arguments: Mapping[str, str]) -> dict[str, object]:
    """Entries of the answer for a xacro."""
    try:
        return {"xml": _expanded(path, dict(arguments))}
    except UnknownNameError as error:
        return {"name": error.name, "value": str(error.value), "alternatives": list(error.alternatives)}
    except ParameterError as error:
        return {"name": error.name, "value": str(error.value), "requirement": error.requirement}
    except TeleopError as error:
        return {"text": str(error)}


def _expanded(path: Path, arguments: dict[str, str]) -> str:
    import xacro

    _adapt(path)
    try:
        document = xacro.process_file(str(path), mappings=dict(arguments), verbosity=0)
        expanded: str = document.documentElement.toxml()
    except Exception as error:  # one line names the file for any exception that its expressions raise
        if ours := _wrapped(error):
            raise ours from None
        reason = " ".join(f"{type(error).__name__}: {error}".split())[:_MOST_CHARACTERS]
        file = (xacro.filestack or [path])[-1]
        raise ParameterError("xacro", str(file), f"one that can be expanded ({reason})") from error
    _refuse_unknown(arguments, [path, *map(Path, xacro.all_includes)])
    return expanded


def _wrapped(error: BaseException | None) -> TeleopError | None:
    """TeleopError inside an exception of the package, such as an error of ``$(find NAME)``; None if there is none."""
    while error is not None and not isinstance(error, TeleopError):
        error = getattr(error, "exc", None) or error.__cause__ or error.__context__
    return error


def _refuse_unknown(arguments: Mapping[str, str], files: Iterable[Path]) -> None:
    """Refuse arguments that no file declares; the package accepts them silently."""
    if arguments:
        texts = [file.read_text(encoding="utf-8", errors="replace") for file in files]
        known = sorted({name for text in texts for name in _DECLARED.findall(text)})
        for name in arguments:
            if name not in known:
                raise UnknownNameError("argument of xacro", name, known)


def _adapt(path: Path) -> None:
    """Change three functions of the package, which has no settings for them.

    ``$(find NAME)`` finds the same folder as ``package://NAME``. Document types are refused. ``load_yaml`` loads files
    of data only, and an error in such a file names the line instead of its text, which may be secret.
    """
    import xacro
    import yaml
    from xacro import substitution_args

    parsed, loaded = xacro.parse, xacro.load_yaml

    def find(name: str) -> str:
        return str(visuals.package_folder(name, path))

    def parse(source: object, filename: str) -> object:
        urdf_tree.tree_of(Path(filename).read_bytes())
        return parsed(source, filename)

    def load_yaml(filename: object) -> object:
        name = str(filename)
        if not name.endswith(_LOADED):
            raise ParameterError("load_yaml", name, f"a file that ends in {', '.join(_LOADED)}")
        try:
            return loaded(name)
        except yaml.YAMLError as error:
            mark = getattr(error, "problem_mark", None)
            line = "" if mark is None else f"; see line {mark.line + 1}"
            raise ParameterError("load_yaml", name, f"a file of YAML{line}") from None

    xacro.parse, xacro.load_yaml = parse, load_yaml
    xacro._global_symbols = xacro.create_global_symbols()  # expressions find functions here
    substitution_args._eval_find = substitution_args._eval_dict["find"] = find


if __name__ == "__main__":
    resource.setrlimit(resource.RLIMIT_DATA, (MEMORY, MEMORY))
    print(json.dumps(answer(Path(sys.argv[1]), json.loads(sys.argv[2]))))
