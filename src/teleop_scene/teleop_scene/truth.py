"""Truth: motions and contacts of MuJoCo beside closed forms, and beside our own equations of motion.

Source:
    Pendulum: Landau and Lifshitz 1976, section 11, problem 1. Contacts: MuJoCo's documentation, chapter Computation,
    sections "Reference acceleration" and "Friction cones". Incline: Coulomb's law.
"""

import math
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from scipy.special import ellipk

from teleop_core.kernels import Array
from teleop_core.robots.dynamics.chain_dynamics import chain_acceleration
from teleop_scene.arm import SceneRobot, arm_of

STEP = 1e-3
"""Length of a step [s], as in a session."""
_G = 9.81
_SWING, _LENGTH = 1.0, 0.5  # amplitude [rad] and length [m] of the pendulum
_STIFFNESS, _IMPEDANCE = 4e4, 0.9  # of the ball's contact: [1/s²], and the share that the constraint takes
_SLOPE, _FRICTION = 0.4, 0.3  # angle of the incline [rad], and coefficient of friction
_TIME = 0.5  # of the free motion of an arm [s]

_PENDULUM = f"""<mujoco><option timestep="{STEP}" integrator="implicitfast"/><worldbody><body>
  <joint name="swing" axis="0 1 0"/><geom type="sphere" size="1e-3" pos="0 0 -{_LENGTH}" mass="1" contype="0"/>
</body></worldbody></mujoco>"""
_BALL = f"""<mujoco><option timestep="{STEP}"/><worldbody><geom type="plane" size="1 1 1"
  solref="-{_STIFFNESS} -400" solimp="{_IMPEDANCE} {_IMPEDANCE} 0.001"/>
  <body pos="0 0 0.05"><freejoint/><geom type="sphere" size="0.05" mass="0.2" solref="-{_STIFFNESS} -400"
  solimp="{_IMPEDANCE} {_IMPEDANCE} 0.001"/></body></worldbody></mujoco>"""
_BLOCK = """<mujoco><option timestep="{step}" cone="elliptic" gravity="{gx} 0 {gz}"/><worldbody>
  <geom type="plane" size="9 9 1" friction="{friction}"/>
  <body pos="0 0 0.002"><freejoint/><geom type="box" size="0.1 0.1 0.002" mass="0.5" friction="{friction}"/></body>
</worldbody></mujoco>"""
_ARM = f"""<mujoco><compiler angle="radian"/><option timestep="{STEP}" integrator="RK4"/>
<default><geom type="capsule" size="0.03" contype="0"/></default><worldbody><body pos="0 0 0.3" euler="0 0 0.4">
  <joint name="a" axis="0 0 1" armature="0.01"/><geom fromto="0 0 0 0 0 0.1" mass="1"/>
  <body pos="0 0 0.1"><joint name="b" axis="0 1 0" ref="0.2" armature="0.01"/><geom fromto="0 0 0 0.3 0 0" mass="1.5"/>
    <body pos="0.3 0 0"><joint name="c" axis="0 1 0.3" pos="0.01 0 0"/><geom fromto="0 0 0 0.25 0 0.02" mass="0.8"/>
      <site name="tip" pos="0.25 0 0.02"/></body></body>
</body></worldbody></mujoco>"""


@dataclass(frozen=True)
class Comparison:
    """One figure of MuJoCo beside a known one."""

    name: str
    unit: str
    found: float
    known: float

    @property
    def difference(self) -> float:
        """Difference of both."""
        return self.found - self.known


def comparisons() -> list[Comparison]:
    """All comparisons; they take about a second."""
    return [*pendulum(), *ball(), *incline(), *free_arm()]


def table() -> str:
    """Table of all comparisons as text."""
    lines = [f"{'':44} {'MuJoCo':>12} {'known':>12} {'difference':>12}"]
    for one in comparisons():
        name = f"{one.name} [{one.unit}]"
        lines.append(f"{name:44} {one.found:12.6g} {one.known:12.6g} {one.difference:12.2g}")
    return "\n".join(lines)


def pendulum() -> list[Comparison]:
    """Period of a large swing, and energy after ten periods."""
    model, data = _made(_PENDULUM)
    model.opt.enableflags |= int(mujoco.mjtEnableBit.mjENBL_ENERGY)
    inertia = float(model.body_inertia[1, 0]) + _LENGTH**2
    known = 4.0 * math.sqrt(inertia / (_G * _LENGTH)) * float(ellipk(math.sin(_SWING / 2.0) ** 2))
    data.qpos[0] = _SWING
    mujoco.mj_forward(model, data)
    begin, crossings, last = float(data.energy.sum()), list[float](), _SWING
    while len(crossings) < 20:
        mujoco.mj_step(model, data)
        now = float(data.qpos[0])
        if last * now < 0.0:
            crossings.append(data.time - STEP * now / (now - last))
        last = now
    mujoco.mj_forward(model, data)
    period = 2.0 * (crossings[-1] - crossings[0]) / (len(crossings) - 1)
    return [
        Comparison("pendulum, period of a swing of 1 rad", "s", period, known),
        Comparison("pendulum, energy lost in ten periods", "J", begin - float(data.energy.sum()), 0.0),
    ]


def ball() -> list[Comparison]:
    """Depth and force of a ball that rests on a plane.

    A contact takes the share d of the reference acceleration ``k depth / d`` and leaves the rest of gravity:
    ``(1 - d) g = k depth``.
    """
    model, data = _made(_BALL)
    for _ in range(round(2.0 / STEP)):
        mujoco.mj_step(model, data)
    mujoco.mj_forward(model, data)
    depth, force = 0.05 - float(data.qpos[2]), np.zeros(6)
    mujoco.mj_contactForce(model, data, 0, force)
    known = (1.0 - _IMPEDANCE) * _G / _STIFFNESS
    return [
        Comparison("ball on a plane, depth at rest", "mm", 1e3 * depth, 1e3 * known),
        Comparison("ball on a plane, force at rest", "N", float(force[0]), 0.2 * _G),
    ]


def incline() -> list[Comparison]:
    """Acceleration of a block that slides, and the creep of one that should stick."""
    slides = _slid(_FRICTION, 0.75) - _slid(_FRICTION, 0.25)
    known = _G * (math.sin(_SLOPE) - _FRICTION * math.cos(_SLOPE))
    return [
        Comparison("block on an incline, acceleration", "m/s²", slides / 0.5, known),
        Comparison("block that sticks, speed of its creep", "mm/s", 1e3 * _slid(0.8, 1.0), 0.0),
    ]


def _slid(friction: float, time: float) -> float:
    """Speed [m/s] down the incline after a time [s], from rest."""
    gx, gz = _G * math.sin(_SLOPE), -_G * math.cos(_SLOPE)
    model, data = _made(_BLOCK.format(step=STEP, gx=gx, gz=gz, friction=friction))
    for _ in range(round(time / STEP)):
        mujoco.mj_step(model, data)
    return float(data.qvel[0])


def free_arm() -> list[Comparison]:
    """Largest difference of the joints of a falling arm from our own equations of motion, integrated by Runge-Kutta."""
    model, data = _made(_ARM)
    robot = arm_of(Path("falling_arm.xml"), model)
    q, dq, worst = np.array([0.1, 0.4, -0.6]), np.zeros(3), 0.0
    data.qpos[:] = q
    for _ in range(round(_TIME / STEP)):
        mujoco.mj_step(model, data)
        q, dq = _stepped(robot, q, dq)
        worst = max(worst, float(np.abs(data.qpos - q).max()))
    return [Comparison(f"falling arm, joints within {_TIME:g} s, at most", "µrad", 1e6 * worst, 0.0)]


def _stepped(robot: SceneRobot, q: Array, dq: Array) -> tuple[Array, Array]:
    """Joints and speeds after one Runge-Kutta step without efforts."""
    assert robot.dynamics is not None
    row, nothing = robot.dynamics.parameters.copy(), np.zeros(robot.n)

    def slope(at: Array, speed: Array) -> Array:
        found = np.zeros(robot.n)
        chain_acceleration(at.copy(), speed.copy(), nothing, row, found)
        return found

    half = 0.5 * STEP
    k1 = slope(q, dq)
    k2 = slope(q + half * dq, dq + half * k1)
    k3 = slope(q + half * (dq + half * k1), dq + half * k2)
    k4 = slope(q + STEP * (dq + half * k2), dq + STEP * k3)
    q = q + STEP * dq + STEP**2 / 6.0 * (k1 + k2 + k3)
    return q, dq + STEP / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)


def _made(text: str) -> tuple[mujoco.MjModel, mujoco.MjData]:
    model = mujoco.MjModel.from_xml_string(text)
    return model, mujoco.MjData(model)
