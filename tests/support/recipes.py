"""Recipes: recordings made for a test, of a slave at rest to which something is done."""

import io
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from scipy.spatial.transform import Rotation

from teleop_core.bags import reader, reports
from teleop_core.bags.writer import BagWriter
from teleop_core.graph import STATE_FIELDS, TICK_NS, topics
from teleop_core.kernels.geometry import Array

JOINTS = tuple(f"joint_{i}" for i in range(1, 7))
START_NS = 1_700_000_000 * 1_000_000_000


def terminal(width: int = 80) -> Console:
    """A terminal whose text can be exported."""
    return Console(width=width, record=True, file=io.StringIO(), color_system=None)


def pose_rows(
    count: int,
    position: tuple[float, float, float] = (0.4, 0.0, -0.18),
    angles: tuple[float, float, float] = (0.0, 66.6, 0.0),
) -> Array:
    """Poses (count, 7) at rest; angles are roll, pitch, yaw in degrees."""
    x, y, z, w = Rotation.from_euler("ZYX", angles, degrees=True).as_quat()
    return np.tile([*position, w, x, y, z], (count, 1))


def state(stamp_ns: int, described: dict[str, str] | None = None, **values: float | topics.Limit) -> bytes:
    """Message of teleop/state with everything else zero, but gain 1, of a slave that follows.

    ``described`` holds further names and texts, such as the kind of the fixture.
    """
    is_one = {"gain", "is_following"}
    texts = {name: repr(float(values.get(name, name in is_one))) for name in STATE_FIELDS}
    return reports.report(stamp_ns, "teleop", 0, "FOLLOWING", texts | (described or {}))


class Recipe:
    """A recording of a slave at rest; entries of ``rows`` are (stamps, values, log times)."""

    def __init__(self, count: int = 3000) -> None:
        stamps = START_NS + np.arange(count) * TICK_NS
        poses = pose_rows(count)
        self.rows = {
            topic: (stamps, poses.copy(), stamps)
            for topic in (topics.SLAVE_SERVO_CP, topics.SLAVE_SETPOINT_CP, topics.SLAVE_MEASURED_CP)
        }
        self.stamps = stamps
        self.singles = [(topics.TELEOP_STATE, START_NS, state(START_NS))]
        self.metadata = {"scenario": "at_rest", "robot": "rcrt1", "seed": "7"}
        self.topics = list(topics.ALL)

    def values(self, topic: topics.Topic) -> Array:
        return self.rows[topic][1]

    def drop(self, topic: Any, lost: Any) -> None:
        kept = np.setdiff1d(np.arange(len(self.rows[topic][0])), lost)
        self.rows[topic] = tuple(column[kept] for column in self.rows[topic])

    def delay(self, topic: topics.Topic, delay_ns: int) -> None:
        stamps, values, logs = self.rows[topic]
        self.rows[topic] = (stamps, values, logs + delay_ns)

    def write(self, path: Path) -> reader.Bag:
        with BagWriter(path, self.topics, JOINTS, metadata=self.metadata, start_ns=START_NS) as writer:
            for topic, log_ns, data in self.singles:
                writer.write(topic, log_ns, data)
            longest = max(len(stamps) for stamps, *_ in self.rows.values())
            for i in range(0, longest, 1000):
                writer.write_block(
                    {
                        topic: (a[i : i + 1000], b[i : i + 1000], c[i : i + 1000])
                        for topic, (a, b, c) in self.rows.items()
                    }
                )
        return reader.Bag(path)
