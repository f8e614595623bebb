"""Docstrings, comments and messages of the source: sentences that are read once."""

import ast
import io
import re
import tokenize
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
STYLE = tomllib.loads((ROOT / "docs" / "words.toml").read_text(encoding="utf-8"))
ROOMS = (
    "teleop_core",
    "teleop_machines",
    "teleop_console",
    "teleop_exchange",
    "teleop_scene",
    "teleop_lab",
    "teleop_drill",
)
AVOIDED = STYLE["instead"] | STYLE["glossary"]
ANY = re.compile("|".join(rf"\b(?:{words})" for words in AVOIDED), re.IGNORECASE)
SHORTEST = 6  # words of a message; what has less is a name or a format
# Where a sentence or an item of a list ends, or an entry of Args begins.
ENDS = r"\n\s*\n|\n\s*[-*] |:\n|\n\s*\w+: "


def docstrings(text: str) -> Iterator[str]:
    """Docstrings of a source text, and texts that stand behind a constant."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            yield re.sub(r"^ +teleop .*$", "", str(node.value.value), flags=re.MULTILINE)  # commands


def messages(text: str) -> Iterator[str]:
    """Other texts of some words, as of errors, parameters and help; what is put in is one word."""
    tree = ast.parse(text)
    inside = {part for node in ast.walk(tree) if isinstance(node, ast.JoinedStr) for part in node.values}
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr):
            parts = (p.value if isinstance(p, ast.Constant) else "it" for p in node.values)
            words = "".join(map(str, parts))
        elif isinstance(node, ast.Constant) and node not in inside:
            words = str(node.value)
        else:
            continue
        if len(words.split()) >= SHORTEST and "\n" not in words:
            yield words


def comments(text: str) -> Iterator[str]:
    """Comments of a source text, those of neighbouring lines together."""
    lines: list[str] = []
    last = -1
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.COMMENT:
            if token.start[0] != last + 1 or not token.line.lstrip().startswith("#"):
                yield " ".join(lines)
                lines = []
            lines.append(token.string.lstrip("# "))
            last = token.start[0]
    yield " ".join(lines)


def sentences(text: str) -> Iterator[str]:
    """Sentences of a text; tables are left out."""
    for part in re.split(ENDS, text):
        if "====" not in part:
            yield from re.split(r"(?<=[.!?:;])\s+", " ".join(part.split()))


@pytest.mark.parametrize("room", ROOMS)
def test_docstrings_comments_and_messages_are_read_once(room: str) -> None:
    wrong = []
    for path in sorted((ROOT / "src" / room / room).rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        for words in (*docstrings(text), *comments(text), *messages(text)):
            line = " ".join(words.split())
            found = [one for one in sentences(words) if len(one.split()) > STYLE["longest_sentence"]]
            found += [phrase for phrase in STYLE["never"] if phrase in line]
            found += [f"{one[0]!r}, see docs/words.toml" for one in ANY.finditer(words)]
            wrong += [f"{path.relative_to(ROOT)}: {one}" for one in found]
    assert not wrong, "\n".join(wrong)
