"""Samples: how many slave poses were scored, and why others were not."""

from dataclasses import dataclass

import numpy as np

from teleop_core.evaluation.context import Context
from teleop_core.evaluation.metric import Key, Metric
from teleop_core.evaluation.rows import Row
from teleop_core.evaluation.tracking import TRACKED, tracked
from teleop_core.evaluation.windows import Window


@dataclass(frozen=True)
class Samples:
    """How many slave poses were scored, and why others were not."""

    scored: int
    unpaired: int
    invalid: int


class SamplesMetric(Metric):
    """Counts the poses that the errors are of."""

    name = "samples"
    keys = (
        Key("samples.scored", "1", "slave poses with their reference"),
        Key("samples.unpaired", "1", "slave poses whose reference was lost on the way"),
        Key("samples.invalid", "1",
            "slave poses or references with NaN or without a direction"),
    )  # fmt: skip
    topics = TRACKED

    def __init__(self, context: Context) -> None:
        self._scored = self._unpaired = self._invalid = 0

    def add(self, window: Window) -> None:
        """Take one window."""
        found = tracked(window)
        has_angle = np.isfinite(found.against.angle_deg)
        is_valid = np.isfinite(found.against.position_mm) & has_angle
        self._scored += int(has_angle.sum())
        self._unpaired += int((~found.is_paired).sum())
        self._invalid += int((~is_valid & found.is_paired).sum())

    def values(self) -> Samples:
        """Counts so far."""
        return Samples(self._scored, self._unpaired, self._invalid)

    def rows(self) -> list[Row]:
        """None: tables count messages and ticks."""
        return []
