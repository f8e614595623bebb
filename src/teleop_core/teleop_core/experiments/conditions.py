"""Conditions: with which settings the source's machine is predicted, and what ours changes."""

from teleop_core.experiments.bench import Settings

PREDICTED: Settings = {}
"""Scenarios as they are: the plant and the controller of the source."""
OURS: Settings | None = None
"""The same plant under another controller; None as long as there is none."""
