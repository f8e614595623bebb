"""The RCRT-1 of table A.1, mended, in an engine by others: pinocchio."""

import math
from collections.abc import Sequence

import numpy as np
import pinocchio
from hypothesis import given
from hypothesis import strategies as st
from pinocchio import Model

from teleop_core.kernels.geometry import Array
from teleop_core.robots.arms import rcrt1_dynamics

ROW = rcrt1_dynamics.link_row()
MOTORS = [rcrt1_dynamics.LINKS["J1"], rcrt1_dynamics.LINKS["J2"], rcrt1_dynamics.LINKS["J3"]]
# Accelerations up to some 100 rad/s²: twelve digits of them.
AGREE = 1e-10

# Table A.1, typed again: mass, centre, Ixx Iyy Izz, and the products as ∫xy, ∫xz, ∫yz dm. Frame 1
# of the source stands on its side (z along -y0); link 1 turns about its y alone.
TABLE = (
    (2.404, (0.0, -0.142342, -0.038193), (0.064, 0.012, 0.053), (0.0, 0.0, 0.011)),
    (1.704, (0.031842, 0.0, 0.03594), (0.011, 0.013, 0.004), (6.778e-4, 3.0e-3, 2.24e-4)),
    (0.789, (0.014664, 0.0, -0.264245), (0.061, 0.061, 5.378e-4), (0.0, -3.0e-3, 0.0)),
)

states = st.tuples(
    st.floats(-1.4, 1.4),
    st.floats(0.9, 2.8),
    st.floats(0.1, 0.42),
    *[st.floats(-3.0, 3.0)] * 3,
    st.floats(-6.0, 6.0),
    st.floats(-6.0, 6.0),
    st.floats(-25.0, 25.0),
)


def central(
    mass: float,
    center: tuple[float, float, float],
    moments: tuple[float, float, float],
    products: tuple[float, float, float],
) -> Array:
    """Tensor (3, 3) about the centre of mass, by the parallel-axis theorem."""
    c, (xy, xz, yz) = np.array(center), products
    tensor = np.diag(moments) - np.array([[0, xy, xz], [xy, 0, yz], [xz, yz, 0]])
    return tensor - mass * (c @ c * np.eye(3) - np.outer(c, c))


def ours(state: Sequence[float] | Array) -> Array:
    q, dq, effort, out = np.zeros(6), np.zeros(6), np.zeros(6), np.empty(6)
    q[:3], dq[:3], effort[:3] = state[:3], state[3:6], state[6:]
    rcrt1_dynamics.acceleration(q, dq, effort, ROW, out)
    return out[:3]


def pinocchio_model() -> Model:
    """Joints in the source's own frames: standard Denavit-Hartenberg transforms after each."""
    model, parent, place = pinocchio.Model(), 0, pinocchio.SE3.Identity()
    model.gravity.linear = np.array([0.0, 0.0, -rcrt1_dynamics.LINKS["g"]])
    joints = (pinocchio.JointModelRZ(), pinocchio.JointModelRZ(), pinocchio.JointModelPZ())
    for joint, twist, (mass, center, *rest) in zip(joints, (-math.pi / 2, math.pi / 2, 0.0), TABLE, strict=True):
        parent = model.addJoint(parent, joint, place, f"joint{parent + 1}")
        place = pinocchio.SE3(pinocchio.utils.rotate("x", twist), np.zeros(3))
        body = pinocchio.Inertia(mass, np.array(center), central(mass, center, *rest))
        model.appendBodyToJoint(parent, body, place)
    model.armature = np.array(MOTORS)
    return model


PINOCCHIO = pinocchio_model()


@given(states)
def test_accelerations_are_pinocchios_in_the_frames_of_the_source(state: tuple[float, ...]) -> None:
    q, dq, effort = np.array(state[:3]), np.array(state[3:6]), np.array(state[6:])
    expected = pinocchio.aba(PINOCCHIO, PINOCCHIO.createData(), q, dq, effort)
    assert np.allclose(ours(state), expected, rtol=0, atol=AGREE)
    weight, joints = np.empty(6), np.append(q, np.zeros(3))
    rcrt1_dynamics.gravity_effort(joints, ROW, weight)
    expected = pinocchio.computeGeneralizedGravity(PINOCCHIO, PINOCCHIO.createData(), q)
    assert np.allclose(weight[:3], expected, rtol=0, atol=1e-12)


# --- laws ------------------------------------------------------------------------------------


def test_axes_1_and_2_act_on_each_other_as_much_as_the_table_says() -> None:
    angles = np.radians(np.linspace(50.0, 160.0, 1001))
    D, coupling = np.empty((3, 3)), []
    for angle in angles:
        rcrt1_dynamics.inertia_matrix(np.array([0, angle, 0.3, 0, 0, 0.0]), ROW, D)
        coupling.append(D[0, 1])
    assert math.isclose(max(coupling), math.hypot(6.778e-4, 2.24e-4), rel_tol=1e-5)
    assert math.isclose(max(coupling), 7.1e-4, abs_tol=5e-6)


def test_the_mended_sign_raises_the_inertia_of_axis_1_at_home() -> None:
    D, home = np.empty((3, 3)), np.array([0.0, math.radians(113.4), 0.421, 0, 0, 0])
    rcrt1_dynamics.inertia_matrix(home, ROW, D)
    mended = D[0, 0]
    rcrt1_dynamics.inertia_matrix(home, rcrt1_dynamics.link_row(I3xz=3.0e-3), D)
    assert math.isclose(mended / D[0, 0] - 1.0, 0.037, abs_tol=5e-4)


def test_links_of_the_robot_are_those_of_the_table() -> None:
    for link, row in zip(rcrt1_dynamics.link_inertias(), TABLE, strict=True):
        mass, center, *rest = row
        assert link.mass == mass
        assert np.array_equal(link.center, center)
        assert np.allclose(link.central, central(mass, center, *rest), rtol=0, atol=1e-16)
