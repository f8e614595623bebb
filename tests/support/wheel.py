"""Wheel with kernels, in an environment of its own: arms of 7 and of 12 joints run, and nothing of ours is compiled.

Run as ``python tests/support/wheel.py FOLDER``; the wheels come from ``make wheel``. A kernel that the wheel does not
have must be refused: otherwise the test would prove nothing.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import venv
from pathlib import Path

from jointed import urdf

ROOT = Path(__file__).parents[2]
FORBID = """
import sys
sys.modules["numba.core"] = None  # so that an import of the compiler fails
"""
ARMS = f"""
{FORBID}
import time
from teleop_core.session import api
from teleop_core.session.virtual import VirtualTime

assert "site-packages" in api.__file__, api.__file__
for stages in ("[]", "[network]"):
    for file in sys.argv[1:]:
        begin = time.process_time()
        texts = [f"robot={{file}}", f"teleop.stages={{stages}}", "teleop.duration=1"]
        VirtualTime(api.configuration("coarse_box", texts=texts)).run(1000)
        print(f"{{file}} {{stages}}: {{time.process_time() - begin:.1f}} s of processor time")
"""
OTHER = f"""
{FORBID}
import numpy as np
from teleop_core.kernels import multiply_quaternions

a = np.zeros(4, np.float32)
multiply_quaternions(a, a, a)
"""


def main() -> None:
    """Install the wheel, run the arms and the kernel that it does not have."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("wheels", type=Path, help="folder of the wheels")
    (wheel,) = parser.parse_args().wheels.glob("teleop_core-*-manylinux*.whl")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        venv.create(folder / "venv", with_pip=True)
        python = folder / "venv" / "bin" / "python"
        pip = (str(python), "-m", "pip", "--quiet", "--disable-pip-version-check", "install")
        subprocess.run([*pip, "-c", str(ROOT / "constraints.txt"), str(wheel)], check=True)
        files = [urdf(joints, folder) for joints in (7, 12)]
        print(run(python, folder, ARMS, *map(str, files)).stdout, end="")
        refused = run(python, folder, OTHER, is_sound=False)
        if "numba.core" not in refused.stderr:
            sys.exit(f"a kernel that the wheel does not have was not refused: {refused.stderr}")
    print("nothing of ours was compiled")


def run(
    python: Path, folder: Path, script: str, *arguments: str, is_sound: bool = True
) -> "subprocess.CompletedProcess[str]":
    """Run a script of the environment, whose own cache is empty."""
    known = {key: value for key, value in os.environ.items() if not key.startswith(("NUMBA_", "PYTHON"))}
    command = [str(python), "-c", script, *arguments]
    known["TELEOP_KERNELS"] = str(folder / "kernels")
    done = subprocess.run(command, env=known, cwd=folder, capture_output=True, text=True, check=False)
    if is_sound and done.returncode:
        sys.exit(f"{done.stdout}{done.stderr}")
    return done


if __name__ == "__main__":
    main()
