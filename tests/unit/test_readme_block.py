"""README's commands: in a fresh clone each one finds what it reads, in the order of the page."""

import re
import shlex
import subprocess
from pathlib import Path

ROOT = Path(__file__).parents[2]


def lines() -> list[list[str]]:
    """Words of each command of README's section *Use* up to those that need a session."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    block = text.partition("\n## Use\n")[2].partition("These commands run in this order")[0]
    return [shlex.split(line, comments=True) for line in re.findall(r"^ {4}teleop (.+)$", block, re.MULTILINE)]


def test_each_command_reads_what_the_clone_has_or_an_earlier_command_wrote() -> None:
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    there = set(listed.splitlines())
    assert len(lines()) > 8
    for words in lines():
        written = [words[i + 1] for i, word in enumerate(words) if word in {"--out", "--html", "--store"}]
        assert not there & set(written)
        read = [word for word in words if "/" in word and word not in written]
        assert set(read) <= there, words
        there |= set(written)


def test_no_command_needs_a_shell_that_leaves_brackets_alone() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert not re.findall(r"^ {4}teleop [^#'\n]*\[", text, re.MULTILINE)
