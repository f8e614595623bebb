"""Inertias of links: what a body can have, for every robot and for made-up ones."""

import numpy as np
import pinocchio
import pytest
from hypothesis import given
from hypothesis import strategies as st

from present import present
from teleop_core.base.errors import ParameterError
from teleop_core.robots import drives, inertias, list_robots, load_robot
from teleop_core.robots.arms import rcrt1_dynamics

points = st.lists(st.tuples(st.floats(0.01, 2.0), *[st.floats(-1.0, 1.0)] * 3), min_size=4, max_size=12)


def of_points(cloud: list[tuple[float, float, float, float]]) -> inertias.LinkInertia:
    """Link of point masses (mass, x, y, z): sums over the points, as the definition says."""
    masses, places = np.array([p[0] for p in cloud]), np.array([p[1:] for p in cloud])
    tensor = sum(m * (p @ p * np.eye(3) - np.outer(p, p)) for m, p in zip(masses, places, strict=True))
    center = masses @ places / masses.sum()
    return inertias.LinkInertia(name="cloud", mass=masses.sum(), center=center, inertia=tensor)


def principal(moments: tuple[float, float, float], name: str = "box") -> inertias.LinkInertia:
    return inertias.LinkInertia(name=name, mass=1.0, center=np.zeros(3), inertia=np.diag(moments))


@given(points)
def test_every_cloud_of_masses_has_a_possible_inertia_or_is_flat(
    cloud: list[tuple[float, float, float, float]],
) -> None:
    link = of_points(cloud)
    second = np.linalg.eigvalsh(link.pseudo)
    # Sums of squares: no eigenvalue is negative, whatever the cloud; rounding of 24 kg in 2 m.
    assert second[0] > -1e-13
    if np.linalg.eigvalsh(link.central)[0] > 1e-9:
        inertias.check_possible([link])


@given(points)
def test_central_inertia_is_that_of_pinocchio(cloud: list[tuple[float, float, float, float]]) -> None:
    link = of_points(cloud)
    pseudo = pinocchio.PseudoInertia.FromMatrix(link.pseudo)
    theirs = pinocchio.Inertia.FromPseudoInertia(pseudo)
    assert np.allclose(theirs.lever, link.center, rtol=0, atol=1e-12)
    assert np.allclose(theirs.inertia, link.central, rtol=0, atol=1e-12)


@given(st.tuples(*[st.floats(0.01, 1.0)] * 3))
def test_the_triangle_inequality_is_the_pseudo_inertias_sign(moments: tuple[float, float, float]) -> None:
    link = principal(moments)
    least = np.linalg.eigvalsh(link.pseudo)[0]
    if least > 1e-6:
        inertias.check_possible([link])
    elif least < -1e-6:
        with pytest.raises(ParameterError, match="second moment"):
            inertias.check_possible([link])


@pytest.mark.parametrize("name", list_robots())
def test_every_robot_has_possible_inertias(name: str) -> None:
    robot = load_robot(name)
    inertias.check_possible(present(robot.dynamics).links)
    for link in present(robot.dynamics).links:
        assert np.linalg.eigvalsh(link.pseudo)[0] > 0.0
    assert (present(robot.drives).inertia > 0.0).all()


def test_link_3_with_the_printed_product_and_the_mended_centre_is_refused() -> None:
    with pytest.raises(ParameterError, match=r"'link 3' is -0\.0035.*> 0") as refused:
        inertias.check_possible(rcrt1_dynamics.link_inertias({**rcrt1_dynamics.LINKS, "I3xz": 3.0e-3}))
    assert refused.value.value == pytest.approx(-0.0035226, abs=1e-7)
    # As printed throughout, ahead of the wrist, a body could have the numbers.
    inertias.check_possible(rcrt1_dynamics.link_inertias({**rcrt1_dynamics.LINKS, "I3xz": 3.0e-3, "G3z": 0.264245}))


def test_a_robot_with_an_impossible_link_is_refused_when_it_is_made() -> None:
    bad = principal((1.0, 1.0, 2.5), name="forearm")
    with pytest.raises(ParameterError, match="forearm") as refused:
        drives.Dynamics(
            acceleration=rcrt1_dynamics.acceleration,
            gravity=rcrt1_dynamics.gravity_effort,
            parameters=rcrt1_dynamics.link_row(),
            compensated=np.zeros(6, np.bool_),
            links=(bad,),
        )
    assert refused.value.value == pytest.approx(-0.25)


def test_a_flat_plate_is_possible_and_a_rod_without_thickness_is_not() -> None:
    inertias.check_possible([principal((0.1, 0.2, 0.1 + 0.2))])
    with pytest.raises(ParameterError, match="smallest principal moment"):
        inertias.check_possible([principal((0.1, 0.1, 0.0))])
