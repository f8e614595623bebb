"""What a command says that refuses something."""

import subprocess

COMPILING = "compiling kernels"


def one_line(done: "subprocess.CompletedProcess[str]") -> str:
    """The only line on standard error, beside the one of compiling; nothing on standard output."""
    assert done.stdout == ""
    lines = [line for line in done.stderr.splitlines() if not line.startswith(COMPILING)]
    assert len(lines) == 1, done.stderr
    return lines[0]
