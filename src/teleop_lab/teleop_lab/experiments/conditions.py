"""Conditions: the settings that predict the source's machine, and those with our controller."""

from teleop_lab.experiments.bench import Settings

PREDICTED: Settings = {"plant": "hardware", "controller": "source_pid"}
"""The source's machine under the source's controller."""
OURS: Settings = {"plant": "hardware", "controller": "disturbance_observer"}
"""The same machine under a controller of ours.

Among the laws that track within 3 x 11.4 µm in both modes (experiment ``controllers``), this law has no overshoot, and
its effort changes least from tick to tick. Its orientation errors stay below half a degree near home too, but exceed
the largest yaw error published for the coarse mode.
"""
RESTING: Settings = {"plant": "hardware", "controller": "pid"}
"""For tests whose gains the source tuned for zero error at rest, without regard to tracking (appendix E)."""
