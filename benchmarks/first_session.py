"""First sessions: processor time of the first and of the second session of arms that are new to the machine.

Run with ``python benchmarks/first_session.py``, after ``teleop compile``. Each arm comes from a URDF file, and each
session of one second runs in a process of its own. ``--cold`` begins with an empty cache of kernels, in which
only kernels of the wheel would be found.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "support"))

from jointed import urdf

SESSION = """
import json, sys, time
from teleop_core.session import api
from teleop_core.session.virtual import VirtualTime
from teleop_core.kernels.progress import compiled_count

texts = [f"robot={sys.argv[1]}", "teleop.duration=1"]
session = VirtualTime(api.configuration("coarse_box", texts=texts))
session.run(1000)
used, ticks = time.process_time(), []
for _ in range(7):
    begin = time.process_time()
    session.run(5000)
    ticks.append((time.process_time() - begin) / 5000)
print(json.dumps([used, compiled_count(), 1e6 * min(ticks)]))
"""


def session(file: Path) -> tuple[float, int, float]:
    """Processor time of a process with a session [s], kernels that it compiled, and a tick [µs]."""
    done = subprocess.run([sys.executable, "-c", SESSION, str(file)], capture_output=True, text=True, check=True)
    used, count, tick = json.loads(done.stdout)
    return used, count, tick


def main() -> None:
    """Print a row for each number of joints."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cold", action="store_true", help="begin with an empty cache")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if parser.parse_args().cold:
            os.environ["TELEOP_KERNELS"] = str(folder / "kernels")
        print("joints  first [s]  second [s]  kernels compiled  tick [µs]")
        for joints in range(3, 17):
            file = urdf(joints, folder)
            (first, count, _), (second, _, tick) = session(file), session(file)
            print(f"{joints:6}{first:11.1f}{second:12.1f}{count:18}{tick:11.2f}")


if __name__ == "__main__":
    main()
