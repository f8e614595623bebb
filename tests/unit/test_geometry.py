"""Geometry kernels against scipy's rotations, and at the angles where formulas break."""

import math
from typing import Any

import numpy as np
import pinocchio
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from teleop_core.kernels import Array, geometry, kernel

# Sums of a few products of numbers of size one.
ROUNDING = 1e-14
# Products of two rotations whose own entries are rounded.
TWICE_ROUNDED = 1e-13

component = st.floats(-1.0, 1.0)
quaternions = (
    st.tuples(component, component, component, component)
    .map(np.array)
    .filter(lambda q: np.linalg.norm(q) > 1e-3)
    .map(lambda q: q / np.linalg.norm(q))
)
vectors = st.tuples(*[st.floats(-4.0, 4.0)] * 3).map(np.array)


@kernel
def angle_between(a: Any, b: Any) -> float:
    return geometry.rotation_angle_between(a, b)


@given(quaternions, vectors, vectors, vectors, vectors, vectors)
def test_a_force_has_the_same_power_in_the_frames_of_tip_and_base(
    q: Array, place: Array, force: Array, torque: Array, v: Array, w: Array
) -> None:
    """Each with the twist of its own frame (Murray, Li and Sastry 1994, section 2.5)."""
    pose = np.concatenate((place, q))
    body, spatial = geometry.framed_wrenches(np.concatenate((force, torque)), pose)
    turn = Rotation.from_quat(q, scalar_first=True)
    of_tip = np.concatenate((turn.inv().apply(v), turn.inv().apply(w)))
    at_base = np.concatenate((v - np.cross(w, place), w))
    power = force @ v + torque @ w
    assert body @ of_tip == pytest.approx(power, abs=1e3 * ROUNDING)
    assert spatial @ at_base == pytest.approx(power, abs=1e3 * ROUNDING)


@given(quaternions, vectors, vectors, vectors)
def test_a_force_is_brought_from_tip_to_base_as_pinocchio_does(
    q: Array, place: Array, force: Array, torque: Array
) -> None:
    wrench, pose = np.concatenate((force, torque)), np.concatenate((place, q))
    body, spatial = geometry.framed_wrenches(wrench, pose)
    found = pinocchio.SE3(matrix_of(q), place).act(pinocchio.Force(body))
    np.testing.assert_allclose(found.vector, spatial, atol=1e2 * ROUNDING)


def matrix_of(quaternion: Array) -> Array:
    out = np.empty((3, 3))
    geometry.rotation_from_quaternion(quaternion, out)
    return out


def quaternion_of(matrix: Array) -> Array:
    out = np.empty(4)
    geometry.quaternion_from_rotation(np.ascontiguousarray(matrix), out)
    return out


def scipy_matrix(quaternion: Array) -> Array:
    return Rotation.from_quat(quaternion, scalar_first=True).as_matrix()


@given(quaternions)
def test_rotation_matrix_of_a_quaternion_is_scipys(quaternion: Array) -> None:
    assert np.allclose(matrix_of(quaternion), scipy_matrix(quaternion), rtol=0, atol=ROUNDING)


@given(quaternions)
def test_quaternion_of_its_own_matrix_is_itself_up_to_sign_with_w_not_negative(quaternion: Array) -> None:
    back = quaternion_of(matrix_of(quaternion))
    assert back[0] >= 0.0
    # Half turns have two quaternions of w = 0.
    assert min(np.abs(back - quaternion).max(), np.abs(back + quaternion).max()) < ROUNDING


@pytest.mark.parametrize("axis", [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0), (1, 1, 1), (0, 1, 1)])
@pytest.mark.parametrize("offset", [0.0, 1e-3, 1e-6, 1e-9, 1e-12])
def test_half_turns_keep_all_digits(axis: tuple[int, int, int], offset: float) -> None:
    turn = (math.pi - offset) * np.array(axis) / np.linalg.norm(axis)
    matrix = Rotation.from_rotvec(turn).as_matrix()
    assert np.allclose(matrix_of(quaternion_of(matrix)), matrix, rtol=0, atol=ROUNDING)


@given(quaternions, quaternions)
def test_product_of_quaternions_is_the_product_of_their_matrices(a: Array, b: Array) -> None:
    product = np.empty(4)
    geometry.multiply_quaternions(a, b, product)
    expected = matrix_of(a) @ matrix_of(b)
    assert np.allclose(matrix_of(product), expected, rtol=0, atol=TWICE_ROUNDED)


@given(quaternions, quaternions)
def test_product_may_be_written_over_either_factor(a: Array, b: Array) -> None:
    apart, left, right = np.empty(4), a.copy(), b.copy()
    geometry.multiply_quaternions(a, b, apart)
    geometry.multiply_quaternions(left, b, left)
    geometry.multiply_quaternions(a, right, right)
    assert np.array_equal(left, apart)
    assert np.array_equal(right, apart)


@given(quaternions, vectors)
def test_rotation_vector_turns_in_the_frame_of_the_quaternion(quaternion: Any, turn: Array) -> None:
    out = np.empty(4)
    geometry.rotate_by_vector(quaternion, turn[0], turn[1], turn[2], out)
    expected = scipy_matrix(quaternion) @ Rotation.from_rotvec(turn).as_matrix()
    assert np.allclose(matrix_of(out), expected, rtol=0, atol=TWICE_ROUNDED)


@pytest.mark.parametrize("angle", [0.0, 1e-300, 1e-12, 1e-8, 2.1e-8, 1e-7])
def test_tiny_turns_are_unit_and_exact(angle: float) -> None:
    out = np.empty(4)
    geometry.rotate_by_vector(np.array([1.0, 0, 0, 0]), angle, 0.0, 0.0, out)
    assert math.isclose(np.linalg.norm(out), 1.0, abs_tol=ROUNDING)
    assert math.isclose(out[1], math.sin(0.5 * angle), rel_tol=1e-15)


@given(quaternions, vectors)
def test_pose_and_transform_are_inverse_to_each_other(quaternion: Array, place: Array) -> None:
    pose, back, matrix = np.concatenate((place, quaternion)), np.empty(7), np.empty((4, 4))
    geometry.transform_from_pose(pose, matrix)
    geometry.pose_from_transform(matrix, back)
    assert np.array_equal(matrix[3], [0.0, 0.0, 0.0, 1.0])
    assert np.array_equal(back[:3], place)
    assert np.allclose(matrix_of(back[3:]), matrix_of(quaternion), rtol=0, atol=TWICE_ROUNDED)


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-9, 1e-6, 1e-3, 1.0, 2.0, math.pi - 1e-6, math.pi - 1e-9, math.pi])
def test_angle_between_rotations_keeps_its_digits_small_and_large(angle: float) -> None:
    start = Rotation.from_rotvec([0.3, -0.7, 1.1]).as_matrix()
    axis = np.array([2.0, -1.0, 2.0]) / 3.0
    turned = start @ Rotation.from_rotvec(angle * axis).as_matrix()
    between = angle_between(start, turned)
    assert math.isclose(between, angle, rel_tol=1e-12, abs_tol=1e-15)


@pytest.mark.parametrize("axis", ["x", "y", "z"])
@pytest.mark.parametrize("angle", [-2.0, 0.0, 0.4, math.pi])
def test_coordinate_rotations_are_scipys(axis: str, angle: float) -> None:
    expected = Rotation.from_euler(axis, angle).as_matrix()
    assert np.allclose(geometry.rotation(axis, angle), expected, rtol=0, atol=ROUNDING)


@given(st.floats(-3.1, 3.1), st.floats(-1.5, 1.5), st.floats(-3.1, 3.1))
def test_roll_pitch_yaw_are_the_fixed_angles_that_made_the_rotation(roll: float, pitch: float, yaw: float) -> None:
    turns = (geometry.rotation(axis, a) for axis, a in zip("zyx", (roll, pitch, yaw), strict=True))
    r_z, r_y, r_x = turns
    angles = geometry.roll_pitch_yaw(r_z @ r_y @ r_x)
    # At |pitch| = 1.5 the cosine is 0.07, so rounding grows by fifteen.
    assert np.allclose(angles, (roll, pitch, yaw), rtol=0, atol=2e-14)


@pytest.mark.parametrize("pitch", [math.pi / 2, -math.pi / 2])
@pytest.mark.parametrize("roll", [-2.0, 0.0, 0.7])
def test_roll_pitch_yaw_at_a_right_angle_give_the_rotation_back_with_yaw_zero(pitch: float, roll: float) -> None:
    matrix = geometry.rotation("z", roll) @ geometry.rotation("y", pitch)
    angles = geometry.roll_pitch_yaw(matrix)
    again = geometry.rotation("z", angles[0]) @ geometry.rotation("y", angles[1])
    assert angles[2] == 0.0
    assert np.allclose(again, matrix, rtol=0, atol=ROUNDING)


def test_batches_of_rotations_and_angles_equal_single_ones() -> None:
    rng = np.random.default_rng(3)
    batch = rng.standard_normal((5, 2, 4))
    batch /= np.linalg.norm(batch, axis=-1, keepdims=True)
    matrices = geometry.rotations_from_quaternions(batch)
    angles = geometry.roll_pitch_yaw(matrices)
    for index in np.ndindex(5, 2):
        assert np.allclose(matrices[index], matrix_of(batch[index]), rtol=0, atol=ROUNDING)
        assert np.array_equal(angles[index], geometry.roll_pitch_yaw(matrices[index]))


def rigid() -> Array:
    return geometry.transform(geometry.rotation("y", 0.3), np.array([1.0, 2.0, 3.0]))


@given(quaternions, vectors)
def test_every_rotation_with_a_place_is_rigid(quaternion: Array, place: Array) -> None:
    assert geometry.is_rigid(geometry.transform(matrix_of(quaternion), place))


@pytest.mark.parametrize(
    ("row", "column", "value"),
    [(0, 0, math.nan), (1, 3, math.inf), (0, 0, 0.5), (3, 3, 2.0), (3, 0, 1e-3), (3, 3, math.nan)],
)
def test_matrices_with_one_wrong_entry_are_not_rigid(row: int, column: int, value: float) -> None:
    matrix = rigid()
    matrix[row, column] = value
    assert not geometry.is_rigid(matrix)


@pytest.mark.parametrize("mirror", [(-1, 1, 1), (1, -1, 1), (1, 1, -1), (-1, -1, -1)])
def test_mirrors_are_not_rigid(mirror: tuple[int, int, int]) -> None:
    matrix = rigid()
    matrix[:3, :3] = matrix[:3, :3] @ np.diag(mirror).astype(float)
    assert not geometry.is_rigid(matrix)


def test_rotation_may_be_off_by_a_millionth_but_not_by_more() -> None:
    near, far = rigid(), rigid()
    near[:3, :3] *= 1.0 + 4e-7
    far[:3, :3] *= 1.0 + 6e-7
    assert geometry.is_rigid(near)
    assert not geometry.is_rigid(far)


def test_checked_array_is_a_writable_copy_of_what_may_not_be_written() -> None:
    locked = np.zeros(3)
    locked.setflags(write=False)
    checked = geometry.checked_array("q", locked, (3,))
    assert checked.flags.writeable
    checked[0] = 1.0
    assert locked[0] == 0.0


@given(st.integers(0, 2**32 - 1))
def test_rotation_vectors_run_on_beyond_half_a_turn(seed: int) -> None:
    rng = np.random.default_rng(seed)
    start, axis = Rotation.random(rng=rng), rng.normal(size=3)
    angles = np.linspace(0.0, 6.2, 50)
    vectors = angles[:, None] * axis / np.linalg.norm(axis)
    # Any sign of a quaternion is the same turn.
    quaternions = (start * Rotation.from_rotvec(vectors)).as_quat(scalar_first=True)
    quaternions *= rng.choice((-1.0, 1.0), (50, 1))
    assert np.allclose(geometry.rotation_vectors(quaternions), vectors, rtol=0, atol=1e-12)


@given(quaternions, quaternions)
def test_a_turn_between_two_attitudes_is_scipys_and_never_the_long_way(a: Array, b: Array) -> None:
    start, end = (Rotation.from_quat(q, scalar_first=True) for q in (a, b))
    vector = np.empty(3)
    geometry.turn_between(a, b, vector)
    assert np.linalg.norm(vector) <= math.pi + ROUNDING
    turned = Rotation.from_rotvec(vector) * start
    assert (turned * end.inv()).magnitude() < TWICE_ROUNDED
    geometry.turn_within(a, b, vector)
    assert np.linalg.norm(vector) <= math.pi + ROUNDING
    turned = start * Rotation.from_rotvec(vector)
    assert (turned * end.inv()).magnitude() < TWICE_ROUNDED
