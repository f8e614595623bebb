"""Flaky tests: run tests again and again beside busy processes, and say which failed how often.

    python tests/support/flaky.py                                   # live tests, twenty times
    python tests/support/flaky.py --count 5 tests/ros/test_drill.py -m slow

What CI runs must pass twenty times in a row while others keep both processors busy: a test that
does not is mended before anything else. Ctrl-C ends it and says what was found until then.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from xml.etree import ElementTree

ROOT = Path(__file__).parents[2]
LIVE = "ros and not soak"


def run(arguments: list[str], report: Path) -> dict[str, str]:
    """Outcome of each test of one run of pytest, by its name: passed, failed, error or skipped."""
    command = [sys.executable, "-m", "pytest", "-q", f"--junit-xml={report}", *arguments]
    subprocess.run(command, check=False, cwd=ROOT, stdout=subprocess.DEVNULL)
    if not report.exists():
        raise SystemExit(f"no report of: {' '.join(command)}")
    found = {}
    for case in ElementTree.parse(report).iter("testcase"):
        name = f"{case.get('classname', '').replace('.', '/')}.py::{case.get('name')}"
        bad = [part for part in case if part.tag in {"failure", "error", "skipped"}]
        found[name] = bad[0].tag if bad else "passed"
        for part in bad:
            if part.tag != "skipped":  # a race that was lost is not seen again soon
                print(f"--- {name}\n{part.text}", flush=True)
    if not found:
        raise SystemExit(f"no test was chosen by: {' '.join(command)}")
    return found


def main() -> int:
    """Run tests often; 0 if none failed, 1 else."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=20, help="how often")
    parser.add_argument("--busy", type=int, default=os.cpu_count(), help="busy processes beside it")
    given, rest = parser.parse_known_args()
    chosen = rest or ["-n", "2", "--dist", "worksteal", "-m", LIVE, "tests/ros"]
    busy = [subprocess.Popen([sys.executable, "-c", "while 1: pass"]) for _ in range(given.busy)]
    ran, failed = Counter[str](), Counter[str]()
    try:
        with tempfile.TemporaryDirectory() as folder:
            for number in range(given.count):
                begin = time.monotonic()
                found = run(chosen, Path(folder) / f"{number}.xml")
                bad = [name for name, word in found.items() if word in {"failure", "error"}]
                ran.update(found)
                failed.update(bad)
                took = time.monotonic() - begin
                print(
                    f"{number + 1}/{given.count}: {len(bad)} of {len(found)} failed, {took:.0f} s {'; '.join(bad)}",
                    flush=True,
                )
    except KeyboardInterrupt:
        print("ended early")
    finally:
        for process in busy:
            process.kill()
    for name, times in failed.most_common():
        print(f"{times} of {ran[name]}  {name}")
    print(f"{len(failed)} of {len(ran)} tests failed at least once")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
