"""Coverage of the kernels: unit tests in pure-Python mode, and which lines of kernels they reach.

Compiled code leaves no trace for a coverage tool; with NUMBA_DISABLE_JIT=1 kernels are Python
functions. Run it with ``make coverage``.
"""

import ast
import json
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import coverage

ROOT = Path(__file__).parents[2]
PACKAGES = [ROOT / "src" / name / name for name in ("teleop_core", "teleop_machines")]

# Those of tests/unit that call kernels.
TESTS = (
    "geometry", "filters", "fixtures", "pid", "haptic_master", "motion_scaling", "slave_sim",
    "inverse_kinematics", "operators", "end_stops", "rcrt1", "rcrt1_dynamics", "stewart", "rps3",
    "four_bar", "textbook_arms", "mma", "mma_models", "mma_balance",
    "mma_ik", "three_finger_hand", "scara_stewart", "dh", "robot_laws", "robots", "fixture_parts",
    "controller_parts", "limits", "interpolation", "source_pid", "rigid_body", "motion_estimates",
    "fixture_shapes",
)  # fmt: skip
# Seconds of simulated time or thousands of poses, on lines that others reach too.
SLOW = (
    "nearly_always", "20_000", "fine_scan", "every_reachable", "unreachable_poses", "tremor_has",
    "axes_tremble", "same_seed", "is_white", "fills_its_bounds", "compensation_keeps",
    "integral_stays_bounded", "long_move", "reference_is_held", "under_any_commands",
    "led_out_of_reach", "in_the_graph", "no_other_attitude", "slave_resumes", "speed_follows",
    "old_stamps", "largest_step", "wanted_path", "from_the_future", "lost", "closed_paths",
    "readings", "kicks", "gives_way", "held_to_a_count", "same_bits", "to_the_bit", "retuning",
    "overshoots", "returns_when", "leaves_its_stop", "low_pass_of_5_ms", "is_forgotten",
)  # fmt: skip

# What moves hand and arm; the kernels of recording and scoring have no part in that.
PARTS = ("geometry.py", "signals.py", "fixtures", "controllers", "mapping", "master", "kinematics", "robots", "slave")

SETTINGS = f"""
[run]
parallel = true
patch = subprocess
source = {",".join(map(str, PACKAGES))}
disable_warnings = no-data-collected, module-not-imported
"""


def main() -> int:
    """Print a line for each module with kernels, with the lines that no test reached."""
    with TemporaryDirectory() as folder:
        settings = Path(folder, "settings.ini")
        settings.write_text(SETTINGS + f"data_file = {folder}/data\n")
        code = run_tests(settings)
        report = collect(settings, Path(folder, "report.json"))
    print_table(report)
    return code


def run_tests(settings: Path) -> int:
    files = [str(ROOT / f"tests/unit/test_{name}.py") for name in TESTS]
    coverage_run = ["coverage", "run", "--rcfile", str(settings), "-m"]
    pytest = ["pytest", "-q", "-n", "2", "-p", Path(__file__).stem, *files]
    return subprocess.call(
        [sys.executable, "-m", *coverage_run, *pytest],
        cwd=ROOT,
        env={**os.environ, "NUMBA_DISABLE_JIT": "1", "PYTHONPATH": str(Path(__file__).parent)},
    )


def pytest_collection_modifyitems(items: list[Any]) -> None:
    """Keep the first of all parameters of each test, and none of the slow ones."""
    kept: dict[tuple[Path, str], Any] = {}
    for item in items:
        if not any(words in item.name for words in SLOW):
            kept.setdefault((item.path, item.originalname), item)
    items[:] = kept.values()


def collect(settings: Path, report: Path) -> dict[str, Any]:
    data = coverage.Coverage(config_file=str(settings))
    data.combine()
    data.json_report(outfile=str(report))
    files: dict[str, Any] = json.loads(report.read_text())["files"]
    return files


def kernels(file: Path) -> Iterator[str]:
    """Names of the kernels in a module."""
    for node in ast.parse(file.read_text()).body:
        if isinstance(node, ast.FunctionDef):
            marks = {mark.id for mark in node.decorator_list if isinstance(mark, ast.Name)}
            if marks & {"kernel", "inner"}:
                yield node.name


def print_table(report: dict[str, Any]) -> None:
    counts = [0, 0]
    print("reached  lines  kernels of            lines that no test reached")
    for name, found in sorted(report.items()):
        distribution, _, *place = (ROOT / name).relative_to(ROOT / "src").parts
        rows = [found["functions"][kernel] for kernel in kernels(ROOT / name)]
        if not rows or (distribution == "teleop_core" and place[0] not in PARTS):
            continue
        missing = [line for row in rows for line in row["missing_lines"]]
        lines = sum(row["summary"]["num_statements"] for row in rows)
        counts = [counts[0] + lines, counts[1] + len(missing)]
        print(f"{percent(lines, len(missing))} {lines:6}  {'/'.join(place):34} {spans(missing)}")
    print(f"{percent(*counts)} {counts[0]:6}  all kernels")


def percent(lines: int, missing: int) -> str:
    return f"{100.0 * (1.0 - missing / max(lines, 1)):5.1f} %"


def spans(lines: list[int]) -> str:
    """Line numbers with runs of them joined: 3-5, 9."""
    runs: list[list[int]] = []
    for line in sorted(lines):
        if runs and line == runs[-1][1] + 1:
            runs[-1][1] = line
        else:
            runs.append([line, line])
    return ", ".join(f"{a}-{b}" if a < b else str(a) for a, b in runs)


if __name__ == "__main__":
    sys.exit(main())
