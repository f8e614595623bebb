"""Digests: every stream of the scenarios is that of before, to the bit.

A change that alters physics on purpose makes new digests and says so in the changelog::

    python tests/scenario/test_stream_digests.py > tests/data/stream_digests.json
"""

import hashlib
import json
import math
import sys
from collections import defaultdict
from pathlib import Path

import numpy as np
import pytest

from teleop_core.session.configuration import configure
from teleop_core.session.runner import run_blocks, session_ticks
from teleop_core.session.virtual import VirtualTime
from teleop_core.topics import STREAMS, TELEOP_STATE

SCENARIOS = ("coarse_box", "fine_box", "mode_switching", "free_motion")
SEEDS = (1, 2, 3)
FILE = Path(__file__).parents[1] / "data" / "stream_digests.json"
FIELDS = {
    **{topic.name: topic.field for topic in (*STREAMS, TELEOP_STATE)},
    "slave/setpoint stamps": "slave_setpoint_js_ns",
}
"""What is compared, to its column in the rows of a session."""


def arithmetic() -> str:
    """Digest of what the machine's libraries make of sines and sums, which may round otherwise."""
    x = np.linspace(-400.0, 400.0, 20_011)
    rows = np.sin(np.outer(x[:2000], np.arange(12))).reshape(-1, 3, 4)
    arrays = [np.sin(x), np.cos(x), rows @ np.array([0.5, 0.4, 0.25, 0.15])]
    functions = (math.sin, math.cos, math.tanh, math.atan)
    arrays += [np.array([function(value) for value in x[::7]]) for function in functions]
    return hashlib.sha256(b"".join(array.tobytes() for array in arrays)).hexdigest()[:16]


def digests(scenario: str, seed: int) -> dict[str, str]:
    """First 16 hexadecimal digits of the SHA-256 of each column's bytes, over a whole session."""
    configuration = configure(scenario, settings=[f"seed={seed}"])
    found = defaultdict(hashlib.sha256)
    session = VirtualTime(configuration)
    for block in run_blocks(session, session_ticks(configuration, session)):
        for name, field in FIELDS.items():
            found[name].update(block[field].tobytes())
    return {name: digest.hexdigest()[:16] for name, digest in found.items()}


@pytest.mark.slow
@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("scenario", SCENARIOS)
def test_every_stream_is_that_of_before_to_the_bit(scenario, seed):
    expected = json.loads(FILE.read_text())
    if expected["arithmetic"] != arithmetic():
        pytest.skip("the sines of this machine's libraries round otherwise")
    assert digests(scenario, seed) == expected[f"{scenario}, seed {seed}"]


def make() -> None:
    """Print the digests of the present code."""
    found = {f"{name}, seed {seed}": digests(name, seed) for name in SCENARIOS for seed in SEEDS}
    json.dump({"arithmetic": arithmetic(), **found}, sys.stdout, indent=1)
    print()


if __name__ == "__main__":
    make()
