"""Conditions: with which settings the source's machine is predicted, and what ours changes."""

from teleop_core.experiments.bench import Settings

PREDICTED: Settings = {"plant": "hardware", "controller": "source_pid"}
"""The source's machine under the source's controller."""
OURS: Settings = {"plant": "hardware", "controller": "pid"}
"""The same machine under our controller."""
RESTING: Settings = OURS
"""For tests whose gains the source tuned for no error at rest, tracking ignored (appendix E)."""
