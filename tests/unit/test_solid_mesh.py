"""Solid mesh: triangles enclose what the solids of a robot's bodies do."""

import numpy as np
import pytest

from teleop_core.robots.bodies import Solid, meshes

HERE = np.array([0.1, -0.2, 0.3, np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0])
VOLUMES = {
    Solid("box", (0.1, 0.2, 0.3), HERE, "link"): 0.006,
    Solid("cylinder", (0.1, 0.3), HERE, "link"): np.pi * 0.01 * 0.3,
    Solid("sphere", (0.1,), HERE, "link"): 4.0 / 3.0 * np.pi * 1e-3,
    Solid("capsule", (0.1, 0.3), HERE, "link"): np.pi * 0.01 * 0.3 + 4.0 / 3.0 * np.pi * 1e-3,
}


@pytest.mark.parametrize("solid", VOLUMES, ids=lambda solid: solid.kind)
def test_triangles_of_a_solid_face_outwards_and_enclose_its_volume_about_its_centre(solid: Solid) -> None:
    points, faces = meshes.mesh_of(solid, 64)
    a, b, c = points[faces].transpose(1, 0, 2) - HERE[:3]
    volumes = np.einsum("ij,ij->i", a, np.cross(b, c)) / 6.0  # of pyramids over the centre
    assert volumes.sum() == pytest.approx(VOLUMES[solid], rel=0.01)
    assert (volumes > -1e-12).all()  # they are convex
    centre = (volumes[:, None] * (a + b + c)).sum(axis=0) / 4.0 / volumes.sum()
    np.testing.assert_allclose(centre, 0.0, atol=1e-9)
