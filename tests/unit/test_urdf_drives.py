"""Drives of a URDF from a YAML file: above what the URDF says, kept by recordings."""

from pathlib import Path

import numpy as np
import yaml

import teleop_core as tc
from present import present
from teleop_core.kernels.geometry import Array
from teleop_core.robots import drives, load_robot

URDF = str(Path(__file__).parents[2] / "examples" / "any_arm.urdf")
JOINTS = ("waist", "shoulder", "elbow", "roll", "pitch", "turn")
FULL = dict(zip(drives.ENTRIES, (0.4, 12.0, 3.0, 0.02, 90.0, 1.5, 1e-5, 70.0), strict=True))


def arm(folder: Path, content: str | dict[str, dict[str, float]], **geometry: str) -> tc.Robot:
    path = folder / "drives.yaml"
    path.write_text(content if isinstance(content, str) else yaml.safe_dump(content))
    return load_robot(URDF, tip="tool0", drives=str(path), **geometry)


def test_entries_of_the_file_stand_above_those_of_the_urdf_and_all_others_stay(tmp_path: Path) -> None:
    plain, found = load_robot(URDF, tip="tool0").drives, arm(tmp_path, {"elbow": FULL}).drives
    elbow = JOINTS.index("elbow")
    for name, column in present(found).entries().items():
        expected = present(plain).entries()[name].copy()
        expected[elbow] = FULL[name] + (present(plain).inertia[elbow] if name == "inertia" else 0.0)
        np.testing.assert_allclose(column, expected, rtol=1e-12)
    assert present(found).assumed == present(plain).assumed


def test_what_the_file_states_of_every_joint_is_assumed_no_more(tmp_path: Path) -> None:
    for entry in drives.ENTRIES:
        before = set(present(load_robot(URDF, tip="tool0").drives).assumed)
        after = present(arm(tmp_path, {joint: {entry: FULL[entry]} for joint in JOINTS}).drives).assumed
        assert set(after) == before - {entry}
    full = arm(tmp_path, dict.fromkeys(JOINTS, FULL))
    assert not full.drives_are_assumed


def test_a_motor_adds_its_inertia_to_that_of_the_links_in_either_model(tmp_path: Path) -> None:
    q, still = np.array((0.1, 0.4, -0.8, 0.3, 0.5, 0.2)), np.zeros(6)
    motors = np.array((0.4, 0.3, 0.2, 0.1, 0.08, 0.05))
    content = {name: {"inertia": float(m)} for name, m in zip(JOINTS, motors, strict=True)}
    for dynamics, place in (("links", q), ("independent", load_robot(URDF, tip="tool0").home)):
        plain = load_robot(URDF, tip="tool0", dynamics=dynamics)
        found = arm(tmp_path, content, dynamics=dynamics)

        def inertia(robot: tc.Robot, place: Array = place) -> Array:
            rest = robot.forward_dynamics(place, still, still)
            rows = [robot.forward_dynamics(place, still, e) - rest for e in np.eye(6)]
            return np.linalg.inv(np.array(rows))

        np.testing.assert_allclose(inertia(found) - inertia(plain), np.diag(motors), atol=1e-9, err_msg=dynamics)
