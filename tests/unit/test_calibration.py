"""Calibration: the identification model, its least squares, instruments, tables and mistakes."""

import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml
from scipy.spatial.transform import Rotation

from present import present
from teleop_core.kernels.geometry import Array
from teleop_core.kinematics import dh_kernels
from teleop_core.robots import load_robot, robot_from_table
from teleop_core.robots.arms.as_chain import true_chain
from teleop_core.robots.robot import Robot
from teleop_lab.calibration import (
    CalibrationError,
    ChainModel,
    LinkErrors,
    Measured,
    appendix_e,
    calibrate,
    read_measured,
    simulate,
)
from teleop_lab.calibration.accuracy import of_points
from teleop_lab.calibration.identify import identify, residuals
from teleop_lab.calibration.model import Frame, aligned
from teleop_lab.calibration.poses import optimal_poses, random_poses
from teleop_lab.calibration.report import correction_file
from teleop_lab.calibration.simulate import ruled, tracked, true_errors

CHAINS = ("rcrt1", "puma560", "scara", "planar_3r", "five_axis")
RCRT1 = load_robot("rcrt1")


def drawn_errors(n: int, rng: np.random.Generator, size: float = 1e-3) -> LinkErrors:
    return LinkErrors.from_vector(rng.normal(0.0, size, 4 * n))


def kernel_tips(robot: Robot, errors: LinkErrors, q: Array) -> Array:
    row, T, out = true_chain(robot, errors), np.empty((4, 4)), []
    for joints in q:
        dh_kernels.fk(joints, present(row), T)
        out.append(T[:3, 3].copy())
    return np.array(out)


def measured_at(robot: Robot, errors: LinkErrors, count: int, rng: np.random.Generator, noise: float = 0.0) -> Measured:
    model = ChainModel.of(robot)
    return tracked(model, errors, random_poses(robot, count, rng), noise, rng)


# The model.


@pytest.mark.parametrize("name", CHAINS)
def test_the_tip_of_the_model_is_that_of_the_kernels(name: str) -> None:
    robot, rng = load_robot(name), np.random.default_rng(1)
    q, errors = random_poses(robot, 30, rng), drawn_errors(robot.n, rng, 0.01)
    tips = ChainModel.of(robot).tips(q, np.concatenate((errors.vector, np.zeros(6))))
    assert np.allclose(tips, kernel_tips(robot, errors, q), rtol=0, atol=1e-14)


@pytest.mark.parametrize("name", CHAINS)
def test_slopes_of_the_tip_are_those_of_differences(name: str) -> None:
    robot, rng, step = load_robot(name), np.random.default_rng(2), 1e-6
    turn = Frame(Rotation.random(rng=rng).as_matrix(), rng.normal(0.0, 1.0, 3))
    for model in (ChainModel.of(robot), ChainModel.of(robot, turn)):
        q = random_poses(robot, 20, rng)
        vector = np.concatenate((rng.normal(0.0, 0.02, 4 * robot.n), np.zeros(6)))
        J = model.jacobian(q, vector)
        for i, unit in enumerate(step * np.eye(len(vector))):
            difference = model.tips(q, vector + unit) - model.tips(q, vector - unit)
            # Third derivatives of 2 m over step², and rounding over the step.
            assert np.allclose(J[:, :, i], difference / (2 * step), rtol=0, atol=2e-9)


def test_alignment_is_that_of_scipy() -> None:
    rng = np.random.default_rng(4)
    points = rng.normal(size=(20, 3))
    turn = Rotation.random(rng=rng)
    seen = turn.apply(points) + np.array([0.3, -0.2, 1.0]) + rng.normal(0, 0.01, (20, 3))
    frame = aligned(points, seen)
    theirs, _ = Rotation.align_vectors(seen - seen.mean(axis=0), points - points.mean(axis=0))
    assert np.allclose(frame.rotation, theirs.as_matrix(), rtol=0, atol=1e-12)
    moved = points @ frame.rotation.T + frame.place
    assert np.allclose(moved.mean(axis=0), seen.mean(axis=0), rtol=0, atol=1e-14)


# Least squares.


@pytest.mark.parametrize("name", CHAINS)
def test_errors_of_any_chain_are_found_from_points_without_noise(name: str) -> None:
    robot, rng = load_robot(name), np.random.default_rng(5)
    errors = drawn_errors(robot.n, rng)
    found = identify(ChainModel.of(robot), measured_at(robot, errors, 60, rng), "all")
    fresh = random_poses(robot, 200, rng)
    now, true = (kernel_tips(robot, e, fresh) for e in (found.errors, errors))
    before = np.linalg.norm(kernel_tips(robot, LinkErrors.none(robot.n), fresh) - true, axis=1)
    # What several errors share goes to one of them; that is exact to first order, so that products
    # of two errors of 1e-3 are left, which least squares then shares out.
    assert np.linalg.norm(now - true, axis=1).max() < 5e-5
    assert before.min() > 2e-4


def test_an_arm_with_errors_that_can_be_told_apart_is_found_to_rounding() -> None:
    rng = np.random.default_rng(6)
    names = {"a2": 4e-4, "alpha1": 2e-3, "d3": 5.5e-3, "theta2": -3e-3, "theta5": 4e-3, "d6": 1e-3}
    errors = LinkErrors.of(RCRT1, names)
    found = identify(ChainModel.of(RCRT1), measured_at(RCRT1, errors, 30, rng), list(names))
    assert np.allclose(found.errors.vector, errors.vector, rtol=0, atol=1e-13)
    assert found.names == ("a2", "alpha1", "d3", "d6", "theta2", "theta5")


@pytest.mark.parametrize("is_elsewhere", [False, True])
def test_a_frame_that_nobody_knows_costs_no_accuracy(is_elsewhere: bool) -> None:
    rng, model = np.random.default_rng(7), ChainModel.of(RCRT1)
    errors = LinkErrors.of(RCRT1, {"d3": 5.5e-3, "theta4": 2e-3})
    q = random_poses(RCRT1, 40, rng)
    measured = tracked(model, errors, q, 0.0, rng, is_elsewhere=is_elsewhere)
    found = identify(model, measured, ["d3", "theta4"], finds_frame=True)
    assert np.allclose(found.errors.vector, errors.vector, rtol=0, atol=1e-12)
    assert np.abs(residuals(found.model, measured, found.vector)).max() < 1e-12
    if is_elsewhere:
        with pytest.raises(CalibrationError, match="unknown"):
            identify(model, measured, "offsets")


def test_intervals_hold_the_truth_as_often_as_they_say() -> None:
    names, rng, model = (["d3", "theta1", "theta2", "theta5"], np.random.default_rng(8), ChainModel.of(RCRT1))
    errors, inside, trials = LinkErrors.of(RCRT1, {"d3": 1e-3, "theta2": 1e-3}), 0, 120
    true = errors.vector[[model.names.index(name) for name in names]]
    q = random_poses(RCRT1, 12, rng)
    for _ in range(trials):
        found = identify(model, tracked(model, errors, q, 1e-4, rng), names)
        inside += (np.abs(found.values - true) < found.half_widths).sum()
    share = inside / (4 * trials)
    # 95 %, and four standard deviations of a share of 480 that hang together a little.
    assert abs(share - 0.95) < 4 * math.sqrt(0.95 * 0.05 / 480) + 0.005


# What can be told apart.


def test_what_cannot_be_told_apart_is_named_with_what_it_acts_as() -> None:
    measured = measured_at(RCRT1, LinkErrors.none(6), 60, np.random.default_rng(10))
    left = {entry.name: entry.reason for entry in identify(ChainModel.of(RCRT1), measured, keeps_all=True).left}
    # On the tool's axis lies the tip: its turn does nothing. Slides along one axis are one, as
    # are turns about it; links 2 and 3 have parallel x axes.
    assert left["theta6"] == left["alpha6"] == "does not change what is measured"
    assert left["d4"] == "acts as d3"
    assert left["theta3"] == "acts as theta4"
    assert {"a2", "a3"} & set(left)
    assert "d3" not in left


def test_errors_that_are_not_told_from_zero_stay_zero() -> None:
    rng = np.random.default_rng(12)
    measured = measured_at(RCRT1, LinkErrors.of(RCRT1, {"d3": 5.5e-3}), 40, rng, 1e-4)
    kept = identify(ChainModel.of(RCRT1), measured, keeps_all=True)
    pruned = identify(ChainModel.of(RCRT1), measured)
    assert "d3" in pruned.names
    assert len(pruned.names) < 6 < len(kept.names)
    assert all(abs(v) >= h for v, h in zip(pruned.values, pruned.half_widths, strict=True))


def test_an_arm_that_is_as_drawn_is_said_to_be() -> None:
    nothing = simulate(RCRT1, poses=30, noise="ruler", errors=["d3=0"])
    assert not nothing.found.names
    assert nothing.fitted.before == nothing.fitted.after
    assert "as drawn" in str(nothing)
    assert robot_from_table(nothing.table()).fk(RCRT1.home) == pytest.approx(RCRT1.fk(RCRT1.home), abs=1e-15)


# Published measurements.


def test_one_offset_of_d3_explains_the_published_accuracy_test() -> None:
    calibration = calibrate(RCRT1, appendix_e.published(RCRT1), ["d3"])
    value, half = calibration.found.values[0], calibration.found.half_widths[0]
    assert value == pytest.approx(5.5e-3, abs=0.05e-3)
    assert half < 1.5e-3
    before, after = calibration.fitted.before["total"], calibration.fitted.after["total"]
    assert before.rms == pytest.approx(0.744e-3, abs=0.5e-6)
    assert after.rms == pytest.approx(0.352e-3, abs=0.6e-6)
    # Nor does it come from the readings it is tried on.
    assert present(calibration.tried).after["total"].rms < 0.37e-3


# Simulated instruments.


def test_the_offset_of_d3_is_found_with_a_ruler_and_with_a_tracker() -> None:
    for noise, poses, bound in (("ruler", 30, 0.8e-3), (0.1e-3, 40, 0.1e-3)):
        made = simulate(RCRT1, poses=poses, noise=noise, seed=1)
        found = made.found.errors.named()
        assert found["d3"] == pytest.approx(made.equivalent["d3"], abs=bound)
        assert made.equivalent["d3"] == pytest.approx(5.5e-3, abs=0.1e-3)
        before, after = (s["total"].rms for s in (present(made.tried).before, present(made.tried).after))
        assert before == pytest.approx(5.5e-3, rel=0.02)
        assert after < 0.4e-3
        assert noise == "ruler" or after < 0.1e-3


def test_a_ruler_reads_in_half_millimetres_along_one_axis_after_the_other() -> None:
    measured = ruled(ChainModel.of(RCRT1), LinkErrors.of(RCRT1, {"d3": 5.5e-3}), 30)
    halves = present(measured.distances) / 0.5e-3
    assert np.allclose(halves, np.round(halves), rtol=0, atol=1e-9)
    assert measured.labels == ("x",) * 10 + ("y",) * 10 + ("z",) * 10
    way = RCRT1.fk(measured.joints)[:, :3, 3] - RCRT1.fk(RCRT1.home)[:3, 3]
    # As in the source: -x and +z from home, +y from 30 mm before it.
    assert np.allclose(way[:10], np.outer(np.arange(1, 11), [-0.01, 0, 0]), rtol=0, atol=1e-9)
    assert np.allclose(way[10:20, 0], -0.03, rtol=0, atol=1e-9)
    assert np.allclose(way[20:], np.outer(np.arange(1, 11), [0, 0, 0.01]), rtol=0, atol=1e-9)


def test_tolerances_are_drawn_within_their_width_and_values_replace_them() -> None:
    errors = true_errors(RCRT1, ["cnc", "d3=5.5e-3"], np.random.default_rng(1))
    assert errors.d[2] == 5.5e-3
    lengths = np.concatenate((errors.a, np.delete(errors.d, 2)))
    assert np.abs(lengths).max() <= 20e-6
    assert np.abs(lengths).max() > 10e-6
    assert np.abs(np.concatenate((errors.alpha, errors.theta))).max() <= 20e-6 / 0.05
    wider = true_errors(RCRT1, ["prototype"], np.random.default_rng(1))
    assert np.allclose(wider.a, 5.0 * errors.a)


@pytest.mark.parametrize("name", CHAINS)
def test_chosen_poses_tell_more_than_random_ones(name: str) -> None:
    robot = load_robot(name)
    model, worth = ChainModel.of(robot), {}
    rng = np.random.default_rng(13)
    names = identify(model, measured_at(robot, LinkErrors.none(robot.n), 60, rng, 1e-5), keeps_all=True).names
    at = [model.names.index(entry) for entry in names]
    zero = np.zeros(len(model.names))
    for how, q in (("best", optimal_poses(model, 15, names, rng)), ("any", random_poses(robot, 15, rng))):
        J = model.jacobian(q, zero)[:, :, at].reshape(-1, len(at))
        worth[how] = np.linalg.slogdet(J.T @ J)[1]
    # By the k-th root of determinants: random ones would have to be a seventh more.
    assert (worth["best"] - worth["any"]) / len(at) > math.log(1.15)


# Back into the arm.


@pytest.mark.parametrize("name", [*CHAINS, "config/robots/five_axis_sheth_uicker.yaml"])
def test_the_file_of_corrections_is_the_arm_that_was_found(name: str) -> None:
    robot, rng = load_robot(name), np.random.default_rng(14)
    calibration = simulate(robot, poses=30, noise=1e-5)
    arm = robot_from_table(yaml.safe_load(correction_file(calibration)))
    for q in random_poses(robot, 20, rng):
        row, T = true_chain(robot, calibration.found.errors), np.empty((4, 4))
        dh_kernels.fk(q, present(row), T)
        assert np.allclose(arm.fk(q), T, rtol=0, atol=1e-14)
    assert arm.joint_names == robot.joint_names
    assert arm.task_mask == robot.task_mask
    for entry in ("lower", "upper", "home", "start"):
        assert np.allclose(getattr(arm, entry), getattr(robot, entry), rtol=0, atol=1e-15)
    assert np.allclose(present(arm.drives).speed_limit, present(robot.drives).speed_limit)
    assert not present(arm.drives).assumed


def test_an_arm_that_is_led_by_its_corrected_table_goes_where_it_is_sent() -> None:
    calibration, rng = simulate(RCRT1, poses=40, noise=0.1e-3), np.random.default_rng(15)
    arm = robot_from_table(calibration.table())
    poses = RCRT1.fk(RCRT1.start + rng.uniform(-0.2, 0.2, (50, 6)) * [1, 1, 0.1, 1, 1, 1])
    off = {}
    for name, robot in (("drawn", RCRT1), ("corrected", arm)):
        answer = robot.ik_batch(poses, RCRT1.start)
        assert answer.residual[:, 0].max() < 1e-8
        tips = kernel_tips(RCRT1, present(calibration.truth), answer.q)
        off[name] = np.linalg.norm(tips - poses[:, :3, 3], axis=1)
    assert off["drawn"].min() > 5e-3
    assert off["corrected"].max() < 0.2e-3


def test_spreads_are_those_of_pandas() -> None:
    errors = np.random.default_rng(16).normal(0.1, 1.0, (50, 3))
    errors[3, 1] = np.nan
    frame = pd.DataFrame(errors, columns=list("xyz"))
    for axis, one in of_points(errors).items():
        series = frame.dropna().pow(2).sum(axis=1).pow(0.5) if axis == "total" else frame[axis]
        assert one.rms == pytest.approx(math.sqrt(series.pow(2).mean()))
        assert one.deviation == pytest.approx(series.std())
        assert one.largest == pytest.approx(series.abs().max())


# Measurements of others.


def poses_table(count: int = 20, seed: int = 17) -> tuple[pd.DataFrame, Measured]:
    rng = np.random.default_rng(seed)
    measured = measured_at(RCRT1, LinkErrors.of(RCRT1, {"d3": 5.5e-3}), count, rng, 1e-5)
    table = pd.DataFrame(measured.joints, columns=list(RCRT1.joint_names))
    table[["x", "y", "z"]] = measured.points
    return table, measured


def test_a_table_of_poses_is_read_as_it_was_written(tmp_path: Path) -> None:
    table, measured = poses_table()
    table.insert(0, "note", "first")
    table.to_csv(tmp_path / "poses.csv", index=False)
    read = read_measured(tmp_path / "poses.csv", RCRT1)
    assert np.array_equal(read.joints, measured.joints)
    assert np.array_equal(present(read.points), present(measured.points))


def test_units_in_the_head_and_other_separators_are_understood(tmp_path: Path) -> None:
    table, measured = poses_table()
    other = pd.DataFrame()
    for i, name in enumerate(RCRT1.joint_names):
        other[f"q{i + 1} [mm]" if name == "d3" else f"q{i + 1}_deg"] = (
            1e3 * table[name] if name == "d3" else np.degrees(table[name])
        )
    for axis in "xyz":
        other[f"{axis} (mm)"] = 1e3 * table[axis]
    other.to_csv(tmp_path / "poses.csv", index=False, sep=";")
    read = read_measured(tmp_path / "poses.csv", RCRT1)
    assert np.allclose(read.joints, measured.joints, rtol=0, atol=1e-14)
    assert np.allclose(present(read.points), present(measured.points), rtol=0, atol=1e-14)


def test_axes_that_were_not_read_are_left_out(tmp_path: Path) -> None:
    table, _ = poses_table(40)
    table.loc[::2, "x"] = np.nan
    table.to_csv(tmp_path / "poses.csv", index=False)
    measured = read_measured(tmp_path / "poses.csv", RCRT1)
    assert measured.readings == 100
    found = calibrate(RCRT1, measured, "offsets").found
    assert found.errors.d[2] == pytest.approx(5.5e-3, abs=2e-5)


def test_a_pose_that_was_misread_is_named(tmp_path: Path) -> None:
    table, _ = poses_table(40)
    clean = calibrate(RCRT1, Measured(joints=table.iloc[:, :6], points=table.iloc[:, 6:]), ["d3"])
    assert "misread" not in str(clean)
    table.loc[12, "y"] += 0.01
    table.loc[3, "x"] = np.nan
    table.to_csv(tmp_path / "poses.csv", index=False)
    text = str(calibrate(RCRT1, read_measured(tmp_path / "poses.csv", RCRT1), ["d3"]))
    assert "pose 13 is off by" in text


# Mistakes.


def test_too_few_poses_are_refused_with_how_many_it_takes() -> None:
    rng = np.random.default_rng(18)
    measured = measured_at(RCRT1, LinkErrors.none(6), 1, rng, 1e-4)
    with pytest.raises(CalibrationError, match="1 poses give 3 readings, too few for 4"):
        identify(ChainModel.of(RCRT1), measured, ["d3", "theta1", "theta2", "theta5"])
    with pytest.raises(CalibrationError, match="three poses"):
        identify(ChainModel.of(RCRT1), measured, ["d3"], finds_frame=True)


def test_named_errors_that_cannot_be_told_apart_are_refused() -> None:
    measured = measured_at(RCRT1, LinkErrors.none(6), 40, np.random.default_rng(19), 1e-4)
    with pytest.raises(CalibrationError, match=r"not identifiable.*d4 acts as d3"):
        identify(ChainModel.of(RCRT1), measured, ["d3", "d4"])
    with pytest.raises(CalibrationError, match=r"not identifiable.*theta6 does not change"):
        identify(ChainModel.of(RCRT1), measured, ["theta6"])
    still = Measured(joints=np.tile(RCRT1.start, (9, 1)), points=np.tile([0.1, 0.2, 0.3], (9, 1)))
    with pytest.raises(CalibrationError, match="not identifiable"):
        identify(ChainModel.of(RCRT1), still, ["d3", "theta1", "theta2", "theta4", "theta5"])


def test_measurements_of_another_arm_are_refused() -> None:
    rng = np.random.default_rng(20)
    q = random_poses(RCRT1, 40, rng)
    lost = Measured(joints=q, points=rng.uniform(-0.4, 0.4, (40, 3)))
    with pytest.raises(CalibrationError, match=r"far from the drawing|did not converge"):
        identify(ChainModel.of(RCRT1), lost, "offsets")
