"""Conditions: the settings that predict the source's machine, with the source's controller and with our controller."""

from teleop_lab.experiments.bench import Settings

PREDICTED: Settings = {"plant": "hardware", "controller": "source_pid"}
"""The source's machine with the source's controller."""
OURS: Settings = {"plant": "hardware", "controller": "disturbance_observer"}
"""The source's machine with a controller of ours.

Among the laws that track within 3 x 11.4 µm in both modes (experiment ``controllers``), this law has no overshoot, and
its effort changes least from tick to tick. Its orientation errors stay below half a degree near home too, but exceed
the largest yaw error published for the coarse mode.
"""
RESTING: Settings = {"plant": "hardware", "controller": "pid"}
"""Settings of the tests of appendix E. The source tuned their gains for zero error at rest, not for tracking."""
