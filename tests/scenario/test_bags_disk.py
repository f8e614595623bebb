"""Recordings when the disk is full or the process is killed, and how much memory they take."""

import json
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from rosbags.highlevel import AnyReader

from teleop_core.bags.reader import Bag, recover
from teleop_core.base.errors import RecordingError
from teleop_core.graph import topics

RECORDER = """
import json, os, resource, signal, sys
import numpy as np
from teleop_core.graph import topics
from teleop_core.bags.messages import report
from teleop_core.bags.writer import BagWriter
from teleop_core.base.errors import RecordingError

path, compression, seconds, ending = sys.argv[1], sys.argv[2], int(sys.argv[3]), sys.argv[4]
if ending.startswith("limit"):
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    limit = int(ending.removeprefix("limit"))
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, resource.RLIM_INFINITY))
rng = np.random.default_rng(1)
names = tuple("abcdef")
values = {t: rng.normal(size=(1000, t.width(6))) for t in topics.STREAMS}
told = ""
try:
    with BagWriter(path, topics.ALL, names, compression=compression) as writer:
        for second in range(seconds):
            times = np.arange(second * 1000, (second + 1) * 1000) * 1_000_000
            writer.write_block({t: (times, v, times) for t, v in values.items()})
            now = int(times[-1])
            writer.write(topics.TELEOP_STATE, now, report(now, "a", 0, "b", {"c": "d"}))
        if ending == "kill":
            while writer._jobs.qsize():
                pass
            os.kill(os.getpid(), signal.SIGKILL)
except RecordingError as error:
    told = str(error)
print(json.dumps({"told": told, "kilobytes": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss}))
"""


def run_recorder(path: Path, compression: str, seconds: int, ending: str) -> tuple[int, dict[str, Any]]:
    command = [sys.executable, "-c", RECORDER, str(path), compression, str(seconds), ending]
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=False, timeout=600)
    return done.returncode, json.loads(done.stdout or "{}")


def test_a_disk_without_any_room_leaves_nothing_behind(tmp_path: Path) -> None:
    code, result = run_recorder(tmp_path / "bag", "none", 1, "limit100")
    assert code == 0
    assert result["told"].startswith(f"{tmp_path / 'bag'}: cannot be written")
    assert not (tmp_path / "bag").exists()


def test_what_a_killed_process_recorded_is_recovered(tmp_path: Path) -> None:
    code, _ = run_recorder(tmp_path / "bag", "zstd", 5, "kill")
    assert code == -signal.SIGKILL
    with pytest.raises(RecordingError, match="teleop recover"):
        Bag(tmp_path / "bag")
    out, count = recover(tmp_path / "bag")
    series = Bag(out).read(topics.SLAVE_MEASURED_CP)
    assert len(series) >= 3000  # at most the chunk being compressed and its successor are lost
    with AnyReader([out]) as reader:
        assert sum(1 for _ in reader.messages()) == count


@pytest.mark.slow
def test_memory_does_not_grow_with_the_length_of_the_recording(tmp_path: Path) -> None:
    _, short = run_recorder(tmp_path / "short", "lz4", 20, "end")
    _, long = run_recorder(tmp_path / "long", "lz4", 200, "end")
    assert long["kilobytes"] < 1.1 * short["kilobytes"]
