"""Xacro: a macro file of an arm, expanded to its URDF by the package ``xacro``.

Expanding evaluates the expressions of the file and of all that it includes: a xacro is a program (docs/security.md).
"""

import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from teleop_core.base import ParameterError, TeleopError, UnknownNameError, damage_told
from teleop_core.robots.files import urdf_tree, visuals

EXPANDED = ".expanded.urdf"
"""Suffix of the expanded URDF that a recording stores for a xacro. Arguments for such a file are allowed and
ignored."""
_DECLARED = re.compile(r"<xacro:arg\s[^>]*?name=[\"']([^\"']+)")
_MOST_CHARACTERS = 300  # characters kept of the package's message, which may be pages long


def xml_of(path: Path, arguments: Mapping[str, str]) -> bytes:
    """XML of a URDF, expanded if the name of the file ends in ``.xacro``.

    Args:
        path: The file.
        arguments: Texts for the ``<xacro:arg>`` of the file, by their names.

    Raises:
        RecordingError: The file cannot be read.
        ParameterError: The file cannot be expanded, or arguments are given for a file that is not a xacro.
        UnknownNameError: Neither the file nor a file that it includes declares such an argument.
        TeleopError: The package ``xacro`` is not installed.
    """
    with damage_told(path):
        data = path.read_bytes()
    if path.suffix.lower() != ".xacro":
        if arguments and not path.name.endswith(EXPANDED):
            needed = f"left out: {path} is no .xacro"
            raise ParameterError("arguments of xacro", list(arguments), needed)
        return data
    return _expanded(path.resolve(), dict(arguments))


def _expanded(path: Path, arguments: dict[str, str]) -> bytes:
    try:
        import xacro
    except ImportError as error:
        text = f"{path} needs xacro: pip install 'teleop_core[urdf]'"
        raise TeleopError(text) from error
    before = len(xacro.all_includes)
    try:
        with _our_files(path):
            document = xacro.process_file(str(path), mappings=dict(arguments), verbosity=0)
        expanded: str = document.documentElement.toxml()
    except Exception as error:  # one line names the file for any exception that its expressions raise
        if ours := _wrapped(error):
            raise ours from None
        reason = " ".join(f"{type(error).__name__}: {error}".split())[:_MOST_CHARACTERS]
        file = (xacro.filestack or [path])[-1]
        raise ParameterError("xacro", str(file), f"one that can be expanded ({reason})") from error
    _refuse_unknown(arguments, [path, *map(Path, xacro.all_includes[before:])])
    return expanded.encode()


def _wrapped(error: BaseException | None) -> TeleopError | None:
    """TeleopError inside an exception of the package, such as an error of ``$(find NAME)``; None if there is none."""
    while error is not None and not isinstance(error, TeleopError):
        error = getattr(error, "exc", None) or error.__cause__ or error.__context__
    return error


def _refuse_unknown(arguments: Mapping[str, str], files: list[Path]) -> None:
    """Refuse arguments that no file declares; the package accepts them silently."""
    if arguments:
        texts = [file.read_text(encoding="utf-8", errors="replace") for file in files]
        known = sorted({name for text in texts for name in _DECLARED.findall(text)})
        for name in arguments:
            if name not in known:
                raise UnknownNameError("argument of xacro", name, known)


@contextmanager
def _our_files(path: Path) -> Iterator[None]:
    """Make ``$(find NAME)`` find the same folder as ``package://NAME``, and refuse document types.

    The package has no settings for these two changes, so its functions are replaced during the expansion.
    """
    import xacro
    from xacro import substitution_args

    def find(name: str) -> str:
        return str(visuals.package_folder(name, path))

    def parse(source: object, filename: str) -> object:
        urdf_tree.tree_of(Path(filename).read_bytes())
        return theirs(source, filename)

    theirs, found = xacro.parse, substitution_args._eval_find
    xacro.parse = parse
    substitution_args._eval_find = substitution_args._eval_dict["find"] = find
    try:
        yield
    finally:
        xacro.parse = theirs
        substitution_args._eval_find = substitution_args._eval_dict["find"] = found
