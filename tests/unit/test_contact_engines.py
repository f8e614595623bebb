"""Contact against MuJoCo: bodies that bounce, slide, stick, roll and rest, in both engines.

The laws of the normal force differ: ours is that of Hunt and Crossley, MuJoCo's a linear spring and
damper in accelerations, or its default. What is compared does not depend on that, or both are given
the same spring. Theory stands beside both where there is some.
"""

import math
from collections.abc import Sequence

import mujoco
import numpy as np
import pytest
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from free_tool import fly
from teleop_core.kernels.geometry import Array

G, MASS = 9.81, 0.2
IMPEDANCE = 2e-4
"""Of MuJoCo's contacts as springs: so small that other forces do not change them."""

WORLD = """<mujoco>
  <option timestep="1e-4" gravity="{gravity}" cone="elliptic" impratio="{impratio}"
          integrator="implicitfast"/>
  <worldbody>
    <geom type="plane" size="0 0 1" friction="{friction} 0 0"/>
    <body pos="{begin}">
      {joints}
      <inertial pos="0 0 0" mass="{mass}" diaginertia="{inertia} {inertia} {inertia}"/>
      {balls}
    </body>
  </worldbody>
</mujoco>"""
SLIDES = '<joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 0 1"/>'
HINGE = '<joint type="hinge" axis="0 1 0"/>'


def row(values: ArrayLike) -> str:
    """Numbers as XML takes them."""
    return " ".join(repr(float(value)) for value in np.ravel(values))


class Other:
    """A body of balls in MuJoCo over the plane z = 0, in the plane x, z.

    Args:
        begin: Place of its first ball, where its centre of mass is, (3,) [m].
        ways: Of all balls from there (N, 3) [m].
        stiffness: Of each contact [N/m]; None for MuJoCo's default contact.
        damping: Of each contact [N·s/m].
        joints: XML of its joints.
    """

    def __init__(
        self,
        begin: tuple[float, float, float],
        ways: Sequence[Sequence[float]] | Array = ((0, 0, 0),),
        radius: float = 0.01,
        stiffness: float | None = None,
        damping: float = 0.0,
        friction: float = 0.0,
        joints: str = SLIDES,
        inertia: float = 1.0,
        gravity: tuple[float, float, float] = (0.0, 0.0, -G),
    ) -> None:
        ball = '<geom type="sphere" size="{}" pos="{}" mass="0" priority="1" condim="{}" {}/>'
        soft = "" if stiffness is None else f'solimp="{IMPEDANCE} {IMPEDANCE} 0.001"'
        balls = "".join(
            ball.format(radius, row(way), 3 if friction else 1, f'friction="{friction} 0 0" {soft}') for way in ways
        )
        text = WORLD.format(gravity=row(gravity), impratio=100, friction=friction, mass=MASS,
                            begin=row(begin), joints=joints, inertia=inertia,
                            balls=balls)  # fmt: skip
        self.model = mujoco.MjModel.from_xml_string(text)
        self.data = mujoco.MjData(self.model)
        if stiffness is not None:
            weight = self.model.body_invweight0[1, 0]  # what it takes for 1 / mass at a contact
            self.model.geom_solref[1:] = (-stiffness * weight, -damping * weight)

    def fly(self, speed: tuple[float, ...], ticks: int) -> Array:
        """Joints (ticks, n) and speeds (ticks, n) at ticks of 1 ms."""
        self.data.qvel[: len(speed)] = speed
        found = np.empty((2, ticks, self.model.nv))
        for tick in range(ticks):
            found[0, tick], found[1, tick] = self.data.qpos[: self.model.nv], self.data.qvel
            mujoco.mj_step(self.model, self.data, 10)
        return found


def restitution(a: float, speed: float) -> float:
    """Share of its speed with which a mass leaves a wall of Hunt and Crossley's, exponent 1.

    ``m v dv = -K x (1 + a v) dx`` from touch to touch: v / a - ln(1 + a v) / a² is the same before
    and after, whatever mass and stiffness are (Hunt and Crossley 1975, integrated).
    """

    def kept(v: float) -> float:
        return v / a - math.log1p(a * v) / a**2

    return -brentq(lambda v: kept(v) - kept(speed), -min(speed, (1.0 - 1e-9) / a), -1e-9) / speed


def damped_restitution(damping: float, stiffness: float) -> float:
    """The same of a mass on a linear spring and damper that does not pull.

    Source:
        Schwager and Pöschel 2007, for damping below critical: the mass leaves where force ends.
    """
    half = 0.5 * damping / MASS
    rate = math.sqrt(stiffness / MASS - half**2)
    return math.exp(-half / rate * (math.pi - math.atan2(2 * half * rate, rate**2 - half**2)))


def bounces(height: Array, speed: Array, gap: float = 2e-3) -> tuple[float, float]:
    """Rebound height over drop, and time in the air, of the first bounce of a dropped body.

    Args:
        height: Above where it touches (N,) [m], of ticks of 1 ms.
        speed: Upwards (N,) [m/s].
        gap: Above which it is surely in the air [m].
    """
    in_air = height > gap
    first = np.flatnonzero(~in_air)[0]
    rise = first + np.flatnonzero(in_air[first:])[0]
    fall = rise + np.flatnonzero(~in_air[rise:])[0]
    return height[rise:fall].max() / height[0], (fall - rise) * 1e-3


@pytest.mark.parametrize("stiffness", [1000.0, 20_000.0])
@pytest.mark.parametrize("speed", [0.1, 2.0])
@pytest.mark.parametrize("damping", [0.1, 1.0, 3.0])
def test_a_wall_gives_back_the_speed_that_theory_says_whatever_the_stiffness(
    damping: float, speed: float, stiffness: float
) -> None:
    ours = fly((0.0, 0.0, 0.001), (0.0, 0.0, -speed), 300, mass=MASS, world_stiffness=stiffness,
               world_damping=damping, gravity=(0.0, 0.0, 0.0))  # fmt: skip
    assert ours["speed"][-1, 2] / speed == pytest.approx(restitution(damping, speed), rel=0.02)


@pytest.mark.parametrize("damping", [0.2, 1.0])
def test_a_body_bounces_as_high_and_as_long_as_mujocos_of_the_same_restitution(damping: float) -> None:
    drop, stiffness = 0.1, 50_000.0
    wanted = restitution(damping, math.sqrt(2.0 * G * drop))
    other_damping = brentq(lambda c: damped_restitution(c, stiffness) - wanted, 0.1, 150.0)
    ours = fly((0.0, 0.0, drop), (0.0, 0.0, 0.0), 600, mass=MASS, world_stiffness=stiffness,
               world_damping=damping, gravity=(0.0, 0.0, -G))  # fmt: skip
    q, dq = Other((0.0, 0.0, drop + 0.01), stiffness=stiffness, damping=other_damping).fly((), 600)
    share, time = bounces(ours["place"][:, 2], ours["speed"][:, 2])
    other_share, other_time = bounces(q[:, 1] + drop, dq[:, 1])
    assert share == pytest.approx(wanted**2, rel=0.06)  # the weight presses during the bounce
    assert share == pytest.approx(other_share, rel=0.03)
    assert time == pytest.approx(other_time, abs=5e-3)


def test_without_damping_a_bounce_is_mujocos_at_every_moment() -> None:
    stiffness, drop = 5000.0, 0.05
    ours = fly((0.0, 0.0, drop), (0.0, 0.0, 0.0), 800, mass=MASS, world_stiffness=stiffness, gravity=(0.0, 0.0, -G))
    q, _ = Other((0.0, 0.0, drop + 0.01), stiffness=stiffness).fly((), 800)
    assert ours["place"][:, 2].min() < -4e-3
    assert np.abs(q[:, 1] + drop - ours["place"][:, 2]).max() < 1e-3


@pytest.mark.parametrize("stiffness", [200.0, 5000.0])
def test_a_body_at_rest_lies_as_deep_as_its_weight_over_the_stiffness(stiffness: float) -> None:
    begin, depth = -MASS * G / stiffness, MASS * G / stiffness
    critical = 2.0 * math.sqrt(stiffness * MASS)
    ours = fly((0.0, 0.0, 0.5 * begin), (0.0, 0.0, 0.0), 8000, mass=MASS, world_damping=100.0,
               world_stiffness=stiffness, gravity=(0.0, 0.0, -G))  # fmt: skip
    other = Other((0.0, 0.0, 0.01), stiffness=stiffness, damping=critical)
    q, _ = other.fly((), 2000)
    assert -ours["place"][-1, 2] == pytest.approx(depth, rel=1e-3)
    assert -q[-1, 1] == pytest.approx(depth, rel=2e-3)


@pytest.mark.parametrize("points", [1, 4])
@pytest.mark.parametrize("friction", [0.1, 0.5])
def test_a_sliding_body_stops_where_friction_says_and_where_mujocos_stops(friction: float, points: int) -> None:
    """After v² / 2 μ g, and as soon as v / μ g, on one point or four."""
    stiffness, begin = 20_000.0, (0.0, 0.0, -MASS * G / 20_000.0 / points)
    ours = fly(begin, (1.0, 0.0, 0.0), 1500, (1.0, 0.0, 0.0), points=points, mass=MASS,
               inertia=1e6, world_friction=friction, world_stiffness=stiffness,
               gravity=(0.0, 0.0, -G))  # fmt: skip
    q, dq = Other((0.0, 0.0, 0.01), friction=friction).fly((1.0, 0.0), 1500)
    way, time = 0.5 / (friction * G), 1.0 / (friction * G)
    assert ours["place"][-1, 0] == pytest.approx(way, rel=0.01)
    assert q[-1, 0] == pytest.approx(way, rel=0.03)
    stopped = [np.flatnonzero(speed < 0.01)[0] * 1e-3 for speed in (ours["speed"][:, 0], dq[:, 0])]
    assert stopped[0] == pytest.approx(0.99 * time, rel=0.02)
    assert stopped[1] == pytest.approx(0.99 * time, rel=0.05)


@pytest.mark.parametrize("friction", [0.2, 0.6])
def test_on_a_slope_a_body_sticks_below_the_angle_of_friction_and_slides_above_it(friction: float) -> None:
    stiffness, angle = 20_000.0, math.atan(friction)
    for share in (0.9, 1.2):
        tilt = share * angle
        gravity = (G * math.sin(tilt), 0.0, -G * math.cos(tilt))
        ours = fly((0.0, 0.0, -MASS * G / stiffness), (0.0, 0.0, 0.0), 1000, mass=MASS,
                   world_friction=friction, world_stiffness=stiffness, world_damping=1.0,
                   gravity=gravity)  # fmt: skip
        q, dq = Other((0.0, 0.0, 0.01), friction=friction, gravity=gravity).fly((0.0, 0.0), 1000)
        if share < 1.0:
            # A bristle's bend, and MuJoCo's creep.
            assert ours["place"][-1, 0] < 1e-3
            assert np.ptp(ours["place"][500:, 0]) < 2e-5
            assert q[-1, 0] < 1e-3
        else:
            wanted = 0.5 * G * (math.sin(tilt) - friction * math.cos(tilt))
            gained = [speed[-1] - speed[499] for speed in (ours["speed"][:, 0], dq[:, 0])]
            assert gained[0] == pytest.approx(wanted, rel=0.002)
            assert gained[1] == pytest.approx(wanted, rel=0.03)


def test_a_ball_that_slides_ends_rolling_with_five_sevenths_of_its_speed() -> None:
    """The balance of momentum about the ground, whatever the friction is."""
    radius, stiffness = 0.02, 20_000.0
    inertia = 0.4 * MASS * radius**2
    ours = fly((0.0, 0.0, radius - MASS * G / stiffness), (0.7, 0.0, 0.0), 500, mass=MASS,
               inertia=inertia, tool_radius=radius, world_friction=0.3, world_damping=1.0,
               world_stiffness=stiffness, gravity=(0.0, 0.0, -G))  # fmt: skip
    other = Other((0.0, 0.0, radius), radius=radius, friction=0.3, joints=SLIDES + HINGE, inertia=inertia)
    _, dq = other.fly((0.7, 0.0, 0.0), 500)
    assert ours["speed"][-1, 0] == pytest.approx(0.5, rel=0.01)
    assert ours["speed"][-1, 4] == pytest.approx(0.5 / radius, rel=0.02)
    assert dq[-1, 0] == pytest.approx(0.5, rel=0.02)
    sliding = slice(0, 60)
    np.testing.assert_allclose(ours["speed"][sliding, 0], dq[sliding, 0], atol=0.02)


@pytest.mark.parametrize("tilt", [0.0, 0.2, 0.5])
def test_a_rod_with_several_points_tumbles_as_mujocos_rod_of_balls(tilt: float) -> None:
    """Without friction and damping, both with the same spring at each of five points."""
    length, radius, inertia, stiffness, drop = 0.08, 0.005, 4e-4, 3000.0, 0.03
    axis = np.array([math.cos(tilt), 0.0, math.sin(tilt)])
    ways = -np.linspace(0.0, length, 5)[:, None] * axis
    begin = (0.0, 0.0, drop + radius - min(ways[:, 2].min(), 0.0))
    ours = fly(begin, (0.0, 0.0, 0.0), 250, axis, points=5, tool_length=length, tool_radius=radius,
               mass=MASS, inertia=inertia, world_stiffness=stiffness,
               gravity=(0.0, 0.0, -G))  # fmt: skip
    other = Other(begin, ways, radius, stiffness, joints=SLIDES + HINGE, inertia=inertia)
    q, _ = other.fly((), 250)
    assert np.ptp(ours["turn"][:, 1]) > 0.3
    assert np.abs(ours["turn"][:, 1] - q[:, 2]).max() < 0.03 * np.ptp(q[:, 2])
    assert np.abs(ours["place"][:, 2] - begin[2] - q[:, 1]).max() < 0.03 * np.ptp(q[:, 1])
