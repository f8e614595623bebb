"""Transmission: from the commanded effort to the effort of the motors; play and tendons behind the encoders."""

from typing import Annotated

from teleop_core.kernels import Array, Fields, PerJoint, inner
from teleop_core.slave.arm import ArmParts

LONGEST_DELAY = 30
"""Largest delay of efforts [ticks]."""


class TransmissionRecord(Fields):
    """Fields of a parameter record with drives and transmission."""

    play: PerJoint  # half width, between encoder and joint [rad or m]
    drive_gain: PerJoint
    effort_step: PerJoint  # [N·m or N]
    bias: PerJoint  # [N·m or N]
    speed_limit: PerJoint  # rated speed [rad/s or m/s]
    delay_ticks: int


class TransmissionState(Fields):
    """Fields of a state record with drives and transmission."""

    carried: PerJoint  # joints behind the play, as the motors last moved them [rad or m]
    late: Annotated[Array, LONGEST_DELAY + 1, "joints"]  # the latest commanded efforts
    driven: int


@inner
def follow_encoders(p: TransmissionRecord, s: TransmissionState, q: Array, coupling: Array, tip: Array) -> None:
    """Write the true joint positions (n,) of motors at ``q`` (n,) [rad or m].

    A joint stays at its position until its motor has crossed the play; then the motor drags the joint. The lag of a
    joint behind its motor moves later joints, whose tendons run over the joint.

    Args:
        p: Parameters.
        s: State; written.
        q: Motor positions, seen through their gears.
        coupling: Motion of a joint per lag of an earlier joint, (n, n), zero on and above the diagonal.
        tip: True joint positions, written.
    """
    for i in range(q.shape[0]):
        pull = q[i]
        for j in range(i):
            if coupling[i, j] != 0.0:
                pull += coupling[i, j] * (q[j] - s.carried[j])
        s.carried[i] = min(max(s.carried[i], pull - p.play[i]), pull + p.play[i])
        tip[i] = s.carried[i]


@inner
def drive(p: TransmissionRecord, s: TransmissionState, arm: ArmParts) -> None:
    """Turn the commanded effort into the effort that the motors give.

    Args:
        p: Parameters.
        s: State; written.
        arm: Arm; its ``effort`` is written.
    """
    if p.delay_ticks > 0:  # in the first ticks the delayed effort is the first effort, which holds the arm
        count = s.late.shape[0]
        late = s.driven - min(p.delay_ticks, s.driven)
        for i in range(arm.q.shape[0]):
            s.late[s.driven % count, i] = arm.effort[i]
            arm.effort[i] = s.late[late % count, i]
        s.driven += 1
    for i in range(arm.q.shape[0]):
        asked, limit, step = arm.effort[i], arm.limit[i], p.effort_step[i]
        if step > 0.0:
            asked = round(asked / step) * step
        arm.effort[i] = min(max(p.drive_gain[i] * asked + p.bias[i], -limit), limit)
        # Beyond its rated speed the motor's driving effort fades to zero over the next tenth of that speed.
        over = abs(arm.dq[i]) / p.speed_limit[i] - 1.0
        if over > 0.0 and arm.effort[i] * arm.dq[i] > 0.0:
            arm.effort[i] *= max(0.0, 1.0 - 10.0 * over)
