"""Solid mesh: triangles enclose what the solids of a robot's bodies do."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from teleop_core.evaluation.packing import pack_to
from teleop_core.evaluation.replay_figure import posed, robot_mesh
from teleop_core.robots import load_robot
from teleop_core.robots.bodies import Solid, bodies_of
from teleop_core.robots.bodies.meshes import mesh_of

HERE = np.array([0.1, -0.2, 0.3, np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0])
VOLUMES = {
    Solid("box", (0.1, 0.2, 0.3), HERE, "link"): 0.006,
    Solid("cylinder", (0.1, 0.3), HERE, "link"): np.pi * 0.01 * 0.3,
    Solid("sphere", (0.1,), HERE, "link"): 4.0 / 3.0 * np.pi * 1e-3,
    Solid("capsule", (0.1, 0.3), HERE, "link"): np.pi * 0.01 * 0.3 + 4.0 / 3.0 * np.pi * 1e-3,
}


@pytest.mark.parametrize("solid", VOLUMES, ids=lambda solid: solid.kind)
def test_triangles_of_a_solid_face_outwards_and_enclose_its_volume_about_its_centre(
    solid: Solid,
) -> None:
    points, faces = mesh_of(solid, 64)
    a, b, c = points[faces].transpose(1, 0, 2) - HERE[:3]
    volumes = np.einsum("ij,ij->i", a, np.cross(b, c)) / 6.0  # of pyramids over the centre
    assert volumes.sum() == pytest.approx(VOLUMES[solid], rel=0.01)
    assert (volumes > -1e-12).all()  # they are convex
    centre = (volumes[:, None] * (a + b + c)).sum(axis=0) / 4.0 / volumes.sum()
    np.testing.assert_allclose(centre, 0.0, atol=1e-9)


def test_points_are_posed_as_by_rotations() -> None:
    rng = np.random.default_rng(1)
    turns = Rotation.random(20, random_state=rng)
    points, places = rng.normal(size=(2, 20, 3))
    poses = np.concatenate((places, turns.as_quat(scalar_first=True)), axis=1)
    np.testing.assert_allclose(posed(points, poses), places + turns.apply(points), atol=1e-12)


def test_mesh_of_a_robot_has_all_solids_in_the_order_of_its_bodies() -> None:
    bodies = bodies_of(load_robot("rcrt1"))
    mesh = robot_mesh(bodies)
    assert set(mesh.body) == {i for i, body in enumerate(bodies.bodies) if body.solids}
    assert (np.diff(mesh.body) >= 0).all()
    assert mesh.faces.max() == len(mesh.points) - 1
    assert (mesh.body[mesh.faces] == mesh.body[mesh.faces[:, :1]]).all()


def test_numbers_packed_to_a_step_take_few_bytes_and_keep_it() -> None:
    values = np.cumsum(np.random.default_rng(2).normal(scale=1e-3, size=5000))
    packed = pack_to(values, 1e-5)
    assert packed.step == 1e-5
    assert packed.order > 0
    assert len(packed.data) < 2.0 * len(values)
