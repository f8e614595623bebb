"""Pages of the reference that are read off the code: commands, public names, examples."""

import ast
import inspect
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

from teleop_core.commands.cli import application

ROOT = Path(__file__).resolve().parents[1]
TITLES = {
    "teleop_core": "Everything a user needs",
    "teleop_console": "A session in the browser, and scores as a page",
    "teleop_exchange": "Recordings of others come in, ours go out",
    "teleop_lab": "Experiments, calibration, fitting and planning",
}


def commands_page() -> list[str]:
    """Every command with its examples and options, as paragraphs."""
    text = application().generate_docs(output_format="markdown")
    return [
        "# Commands",
        "`teleop COMMAND --help` prints the same. Every command takes `--parts FILE.py`, a Python file that registers "
        "[parts of your own](parts.md). Wrong use is told in one line and ends with code 2.",
        text[text.index("## teleop sim") :].strip(),
    ]


def cell(text: str) -> str:
    """Text of a table's cell: in one line, with what Markdown would take for its own."""
    return " ".join(text.split()).replace("|", "\\|").replace("*", "\\*").replace("<", "&lt;")


def api_page() -> list[str]:
    """Public names of the packages, with directives that put their docstrings in."""
    parts = [
        "# API",
        "Names of `import teleop_core as tc`, `import teleop_exchange` and `import teleop_lab as "
        "lab`, by the module that they come from. [Python API](python_api.md) shows them at work. "
        "The site puts each docstring in.",
    ]
    for package, title in TITLES.items():
        parts += [f"## {package}", f"{title}."]
        for module, names in stub(package):
            heading = f"### {package}.{module}".rstrip(".")
            lines = [line for name in names for line in directive(package, name)]
            if lines:
                parts += [heading, "\n".join(["```{eval-rst}", *lines, "```"])]
    return parts


def stub(package: str) -> Iterator[tuple[str, list[str]]]:
    """Module and names of each import of a package's stub."""
    path = Path(str(import_module(package).__file__)).with_suffix(".pyi")
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.ImportFrom):
            yield node.module or "", [alias.name for alias in node.names]


def directive(package: str, name: str) -> list[str]:
    """Directive of autodoc for a public name; modules have none."""
    value = getattr(import_module(package), name)
    if inspect.ismodule(value):
        return []
    if not inspect.isclass(value):
        return [f".. autofunction:: {package}.{name}"]
    if issubclass(value, Exception):
        return [f".. autoexception:: {package}.{name}", "   :show-inheritance:"]
    return [f".. autoclass:: {package}.{name}", "   :members:"]


def examples_page() -> list[str]:
    """All examples with what each does."""
    rows = ["| file | what it does |", "|---|---|"]
    for path in sorted((ROOT / "examples").glob("*.py")):
        first = str(ast.get_docstring(ast.parse(path.read_text(encoding="utf-8")))).split("\n\n")[0]
        rows.append(f"| [{path.name}](../examples/{path.name}) | {cell(first)} |")
    return [
        "# Examples",
        "Short scripts in `examples`. Each runs as it is, and the tests check the numbers that it prints.",
        "\n".join(rows),
    ]
