"""Chain: the stages whose delays are scored, in the order of the data."""

from teleop_core.topics import (
    MASTER_MEASURED_CP,
    SLAVE_SERVO_CP,
    SLAVE_SERVO_JP,
    SLAVE_SETPOINT_JS,
)

CHAIN = (
    ("haptic_master", MASTER_MEASURED_CP),
    ("motion_scaling", SLAVE_SERVO_CP),
    ("inverse_kinematics", SLAVE_SERVO_JP),
    ("slave_sim", SLAVE_SETPOINT_JS),
)
"""Stages and what each sends; every topic carries the stamp of the one before it."""
TOTAL = "total"
STAGES = (*(stage for stage, _ in CHAIN), TOTAL)
"""Names of delays: those of the stages and the whole chain."""
COMMAND = SLAVE_SERVO_CP
"""What the last stage answers in the end; a stamp that it does not carry is nobody's command."""
SLAVE_STAGE = CHAIN[-1][0]
"""Stage that counts the control ticks of the slave."""
