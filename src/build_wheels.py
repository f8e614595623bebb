"""Build wheels of all distributions; of teleop_core a second one, with kernels for x86-64.

``make wheel`` runs it. The second wheel serves one version of Python on any x86-64 processor that
is of the tier; pip takes the pure one elsewhere, and kernels are compiled when they are
first needed, as are those of teleop_machines and the few of teleop_lab.
"""

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from teleop_core.kernels.shipped import FOLDER, TIER

HERE = Path(__file__).resolve().parent
PLATFORM = "manylinux_2_28_x86_64"  # the same platform as numba's wheels
TAG = f"cp{sys.version_info[0]}{sys.version_info[1]}"
CORE = "teleop_core"
OTHERS = (
    "teleop_machines",
    "teleop_console",
    "teleop_exchange",
    "teleop_scene",
    "teleop_lab",
    "teleop_drill",
    "lerobot_robot_teleop_core",
)
COMPILE = "import sys; from teleop_core.commands.cli import main; sys.exit(main(['compile']))"
RUN = """
import hashlib
from teleop_core.session import api
from teleop_core.slave.controllers import CONTROLLERS
from teleop_core.kernels.progress import compiled_count
from teleop_core.robots import ROBOTS
from teleop_core.session.virtual import VirtualTime

sums = hashlib.sha256()
parts = [*({"robot": name} for name in ROBOTS), *({"controller": name} for name in CONTROLLERS)]
for part in parts:
    sums.update(VirtualTime(api.configuration("coarse_box", **part)).run(150).tobytes())
print(compiled_count(), sums.hexdigest())
"""


def main() -> None:
    """Build all wheels from a copy of the sources."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path, help="folder of the wheels")
    out = parser.parse_args().out
    with tempfile.TemporaryDirectory() as folder:
        for package in OTHERS:
            build(copied(package, Path(folder) / package), out)
        tree = copied(CORE, Path(folder) / CORE)
        build(tree, out)
        with ThreadPoolExecutor(1) as beside:  # plain Python takes as long as the compilation, on one processor
            plain = beside.submit(run, tree, None, RUN, NUMBA_DISABLE_JIT="1")
            compile_kernels(tree)
            check(tree, plain.result())
        build(tree, out, f"--plat-name={PLATFORM}", f"--python-tag={TAG}")


def copied(package: str, tree: Path) -> Path:
    """Sources of a distribution, and nothing that was made of them."""
    made = ("__pycache__", "*.egg-info", "build", FOLDER.name)
    return Path(shutil.copytree(HERE / package, tree, ignore=shutil.ignore_patterns(*made)))


def build(tree: Path, out: Path, *options: str) -> None:
    """Build one wheel."""
    settings = [f"--config-settings=--build-option={option}" for option in options]
    pip = (sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check", "wheel")
    subprocess.run([*pip, "--use-pep517", "--no-deps", "--wheel-dir", str(out), *settings, str(tree)], check=True)


def compile_kernels(tree: Path, script: str = COMPILE) -> None:
    """Compile what a Python script needs for the tier, and move it to where the package looks."""
    print(f"{TIER}: {run(tree, TIER, script).strip()}", flush=True)
    package = tree / CORE
    for file in package.rglob("__pycache__/*.nb?"):
        inside = file.parents[1].relative_to(package)
        place = package / "kernels" / FOLDER.name / TIER / inside
        place.mkdir(parents=True, exist_ok=True)
        file.rename(place / file.name)


def run(tree: Path, tier: str | None, script: str, **more: str) -> str:
    """Output of a Python script whose kernels are compiled for a tier, or for this processor if None.

    Args:
        tree: Sources of teleop_core.
        tier: Processor for which numba compiles.
        script: Python text.
        more: Variables of the environment.
    """
    kept = {name: value for name, value in os.environ.items() if not name.startswith("NUMBA_")}
    kept |= {"PYTHONPATH": str(tree), "TELEOP_KERNELS": "", **more}  # kernels beside their sources
    if tier is not None:
        kept |= {"NUMBA_CPU_NAME": tier, "NUMBA_CPU_FEATURES": ""}
    command = [sys.executable, "-c", script]
    done = subprocess.run(command, env=kept, cwd=tree, check=True, stdout=subprocess.PIPE, text=True)
    return done.stdout


def check(tree: Path, plain: str) -> None:
    """Run every robot and law: nothing may be compiled, and all bits must be those of plain Python.

    Args:
        tree: Sources of teleop_core, with the kernels.
        plain: Output of the same script in plain Python.
    """
    count, digest = run(tree, TIER, RUN).split()
    if count != "0":
        sys.exit(f"kernels that were not kept: {count}")
    if digest != plain.split()[1]:
        sys.exit(f"sessions differ from those in plain Python: {digest}, {plain}")
    print("no robot and no law compiles anything; same bits as in plain Python")


if __name__ == "__main__":
    main()
