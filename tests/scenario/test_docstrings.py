"""Docstrings and comments of the source: sentences that are read once."""

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
ROOMS = ("teleop_core", "teleop_console", "teleop_exchange", "teleop_lab", "teleop_drill")
FILES = sorted(path for room in ROOMS for path in (ROOT / "src" / room / room).rglob("*.py"))
# Where a sentence or an item of a list ends, or an entry of Args begins.
ENDS = r"\n\s*\n|\n\s*[-*] |:\n|\n\s*\w+: "


def docstrings(text: str) -> Iterator[str]:
    """Docstrings of a source text, and texts that stand behind a constant."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            yield str(node.value.value)


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


@pytest.mark.parametrize("path", FILES, ids=[str(path.relative_to(ROOT / "src")) for path in FILES])
def test_docstrings_and_comments_are_read_once(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    for words in (*docstrings(text), *comments(text)):
        for sentence in sentences(words):
            assert len(sentence.split()) <= STYLE["longest_sentence"], sentence
        for phrase in STYLE["never"]:
            assert phrase not in " ".join(words.split()), phrase
