"""Policy of LeRobot as operator: its actions are places of the hand."""

import math
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import teleop_core as tc
from teleop_core.hand.operators.rest import rest_pose

_STATE, _GOAL = "observation.state", "observation.environment_state"
_SHAPES = {_STATE: (7,), _GOAL: (3,)}


def lerobot_policy(path: Path | str, device: str = "cpu") -> Callable[[tc.View], NDArray[np.float64]]:
    """Policy for ``tc.register_policy`` from a folder that LeRobot's training wrote; needs ``lerobot``.

    The policy gets ``observation.state``, the pose (7,) of the slave's tip, and, if it wants it,
    ``observation.environment_state``, the position (3,) of the task's goal. Its action is the place (3,) of the hand
    relative to its start, (4,) with the closing of the jaw, or the pose (7,) of the hand as in ``hand/servo_cp``.
    Ask it at the rate of its data set: ``operator.policy.rate``.

    Args:
        path: Folder with ``config.json``, the weights and both processors.
        device: Device of PyTorch.

    Raises:
        PartError: The policy wants other inputs, such as pictures.
        ImportError: LeRobot is not installed.
    """
    torch, factory = import_module("torch"), import_module("lerobot.policies.factory")
    config = import_module("lerobot.configs").PreTrainedConfig.from_pretrained(str(path))
    config.device = device
    wanted = {name: tuple(feature.shape) for name, feature in config.input_features.items()}
    if any(_SHAPES.get(name) != shape for name, shape in wanted.items()):
        raise tc.PartError("policy", str(path), f"one whose inputs are among {_SHAPES}, not {wanted}")
    policy = factory.get_policy_class(config.type).from_pretrained(str(path), config=config)
    moved = {"device_processor": {"device": device}}
    before, after = factory.make_pre_post_processors(config, pretrained_path=str(path), preprocessor_overrides=moved)
    return _Loaded(torch, policy, before, after, tuple(wanted))


class _Loaded:
    """A loaded policy, reset when a session begins."""

    def __init__(self, torch: Any, policy: Any, before: Any, after: Any, inputs: tuple[str, ...]) -> None:
        self._torch, self._policy, self._before, self._after, self._inputs = torch, policy, before, after, inputs
        self._last = math.inf

    def __call__(self, seen: tc.View) -> NDArray[np.float64]:
        if seen.time <= self._last:
            for one in (self._policy, self._before, self._after):
                one.reset()
        self._last = seen.time
        numbers = {_STATE: seen.measured_cp}
        if _GOAL in self._inputs:
            if seen.goal is None:
                return seen.place
            numbers[_GOAL] = seen.goal
        batch = {name: self._torch.from_numpy(numbers[name].astype(np.float32)) for name in self._inputs}
        with self._torch.inference_mode():
            found = self._after(self._policy.select_action(self._before(batch)))
        action = found.squeeze(0).cpu().numpy().astype(np.float64)
        return action[:3] - rest_pose()[:3] if action.shape == (7,) else action
