"""Digests: every stream of the scenarios is that of before, to the bit.

A change that alters physics on purpose makes new digests and says so in the changelog::

    python tests/scenario/test_stream_digests.py > tests/data/stream_digests.json

They are the same on every x86-64 processor since 2013, whatever vector code NumPy and OpenBLAS
choose for it. The C library's sines are what is left: where they round otherwise, the comparison
with the file is skipped, and that between processors still holds.
"""

import hashlib
import json
import math
import os
import platform
import subprocess
import sys
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from teleop_core.graph.topics import STREAMS, TELEOP_STATE
from teleop_core.session import runner, virtual
from teleop_core.session.configuration import configure

SCENARIOS = ("coarse_box", "fine_box", "mode_switching", "free_motion")
SEEDS = (1, 2, 3)
FILE = Path(__file__).parents[1] / "data" / "stream_digests.json"
FIELDS = {
    **{topic.name: topic.field for topic in (*STREAMS, TELEOP_STATE)},
    "slave/setpoint stamps": "slave_setpoint_js_ns",
}
"""What is compared, to its column in the rows of a session."""


SESSIONS = (
    *((scenario, "seed=1") for scenario in SCENARIOS),
    ("coarse_box", "robot=scara_stewart device.handle=mma operator=random controller=adaptive"),
    ("coarse_box", "robot=puma560 operator=line controller=computed_torque fixture=sphere"),
    ("coarse_box", "robot=stewart operator=circle controller=disturbance_observer"),
    ("free_motion", "robot=rps3 controller=friction_compensation"),
    ("free_motion", "robot=three_finger_hand controller=pd"),
    ("free_motion", "robot=four_bar plant=ideal controller=pid"),
)
"""Sessions of 5 s that are compared between processors: every law, plant and kind of robot."""
PROCESSORS = (
    {"OPENBLAS_CORETYPE": "Haswell", "NPY_DISABLE_CPU_FEATURES": "X86_V4,AVX512_ICL,AVX512_SPR"},
    {"OPENBLAS_CORETYPE": "Sandybridge", "NPY_DISABLE_CPU_FEATURES": "X86_V3,X86_V4,AVX512_ICL,AVX512_SPR"},
)
"""What makes NumPy and OpenBLAS compute as on processors with AVX2 and with AVX."""


def arithmetic() -> str:
    """Digest of what the machine's C library makes of some functions, which may round otherwise."""
    x = np.linspace(-400.0, 400.0, 20_011)
    functions = (math.sin, math.cos, math.tanh, math.atan, lambda value: math.exp(value / 40.0))
    arrays = [np.array([function(value) for value in x.tolist()]) for function in functions]
    return hashlib.sha256(b"".join(array.tobytes() for array in arrays)).hexdigest()[:16]


def digests(scenario: str, *settings: str) -> dict[str, str]:
    """First 16 hexadecimal digits of the SHA-256 of each column's bytes, over a whole session."""
    configuration = configure(scenario, settings=settings)
    found: Any = defaultdict(hashlib.sha256)
    session = virtual.VirtualTime(configuration)
    for block in runner.run_blocks(session, runner.session_ticks(configuration, session)):
        for name, field in FIELDS.items():
            found[name].update(block[field].tobytes())
    return {name: digest.hexdigest()[:16] for name, digest in found.items()}


@pytest.mark.slow
@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("scenario", SCENARIOS)
def test_every_stream_is_that_of_before_to_the_bit(scenario: str, seed: int) -> None:
    expected = json.loads(FILE.read_text())
    if (here := arithmetic()) != (there := expected["arithmetic"]):
        library = " ".join(platform.libc_ver())
        pytest.skip(
            f"sines of {library} here round otherwise ({here}) than those of "
            f"{FILE.name} ({there}): nothing to compare with"
        )
    assert digests(scenario, f"seed={seed}") == expected[f"{scenario}, seed {seed}"]


@pytest.mark.slow
def test_tables_of_documents_that_take_sessions_are_what_the_code_says() -> None:
    if arithmetic() != json.loads(FILE.read_text())["arithmetic"]:
        pytest.skip("sines of this machine round otherwise than those of the documents")
    script = Path(__file__).parents[2] / "docs" / "generate.py"
    done = subprocess.run([sys.executable, script, "--check"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.slow
def test_processors_that_round_otherwise_in_numpy_and_blas_give_the_same_bits() -> None:
    here = _short_sessions({})
    for processor in PROCESSORS:
        assert _short_sessions(processor) == here, processor


def _short_sessions(processor: dict[str, str]) -> dict[str, dict[str, str]]:
    """Digests of :data:`SESSIONS`, computed in a process of its own."""
    command = [sys.executable, __file__, "--short"]
    done = subprocess.run(command, env=os.environ | processor, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def short() -> None:
    """Print the digests of :data:`SESSIONS`."""
    found = {
        f"{scenario}, {settings}": digests(scenario, *settings.split(), "duration=5") for scenario, settings in SESSIONS
    }
    json.dump(found, sys.stdout)


def make() -> None:
    """Print the digests of the present code."""
    found = {f"{name}, seed {seed}": digests(name, f"seed={seed}") for name in SCENARIOS for seed in SEEDS}
    json.dump({"arithmetic": arithmetic(), **found}, sys.stdout, indent=1)
    print()


if __name__ == "__main__":
    short() if "--short" in sys.argv else make()
