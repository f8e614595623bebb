"""Errors: they come whole out of the processes in which they were raised."""

import pickle

import pytest

from teleop_core.base import errors

RAISED = (
    errors.TeleopError("no"),
    errors.ParameterError("gain", -1.0, "at least 0"),
    errors.UnknownNameError("robot", "nobot", ("rcrt1", "mma")),
    errors.ClosureError("q", [0.0], "closed", 1e-3),
    errors.PartError("stage", "mine", "a Stage"),
    errors.KernelError("mine.py:3", "no such name"),
    errors.ShapeError("q", (6,), (5,)),
    errors.MessageTypeError("crtk_msgs/msg/OperatingState", "crtk_msgs"),
    errors.RecordingError("bags/one", "is empty"),
    errors.SessionError("first\nsecond"),
)


@pytest.mark.parametrize("error", RAISED, ids=lambda error: type(error).__name__)
def test_an_error_of_another_process_is_the_same(error: errors.TeleopError) -> None:
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is type(error)
    assert str(again) == str(error)
    assert vars(again) == vars(error)


@pytest.mark.parametrize("more", [0, 60])
def test_the_nearest_name_stands_first_and_each_once(more: int) -> None:
    names = ["force_range", "coarse_gain", "force_gain", "force_gain"]
    error = errors.UnknownNameError("key", "force_gian", [*names, *(f"other_{i}" for i in range(more))])
    assert error.alternatives[:3] == ("force_range", "coarse_gain", "force_gain")
    listed = str(error).partition("one of: ")[2].split(", ")
    assert listed[0] == "force_gain"
    assert listed.count("force_gain") == 1
