"""Runs of ``teleop drill``, as the command that people run."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any


def run_drill(tmp_path: Path, *arguments: Any) -> Any:
    """Exit code, output and outcomes by name of ``teleop drill``."""
    file = tmp_path / "drill.json"
    command = [sys.executable, "-m", "teleop_core.commands.cli", "drill", *arguments, "--json", str(file)]
    done = subprocess.run(command, check=False, capture_output=True, text=True, timeout=400)
    text = done.stdout + done.stderr
    assert file.exists(), text
    found = json.loads(file.read_text(encoding="utf-8"))["faults"]
    return done.returncode, text, {one["fault"]: one for one in found}
