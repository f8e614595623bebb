"""Policies as operators: a program that sees observations moves the hand through the whole chain, and hands over.

A policy moves the hand, not the arm. So mapping, fixtures, limits, stops and faults hold for it as for a person. Its
observations may be late, and its actions late or lost, as over a network.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from teleop_core.base import ParameterError
from teleop_core.hand.operators.policy import GIVE_WAY, HandOver, checked_place
from teleop_core.kernels import Array
from teleop_core.session.stepped import Observation, Session

Policy = Callable[[Observation], Array]
"""What a policy is: it takes an observation, and returns the wanted place of the hand (3,) [m], as in
:meth:`teleop_core.Session.command`."""


@dataclass(frozen=True)
class Way:
    """Way between a policy and the session.

    Attributes:
        seen_late: Age of the observations that the policy gets [steps].
        told_late: Delay of its actions [steps].
        loss: Share of its actions that are lost, 0 to 1; the hand then stays at the last one.
        seed: Seed of the losses.
    """

    seen_late: int = 0
    told_late: int = 0
    loss: float = 0.0
    seed: int = 0

    def __post_init__(self) -> None:
        for name, value in (("seen_late", self.seen_late), ("told_late", self.told_late)):
            if not 0 <= value <= 10_000:
                raise ParameterError(name, value, "0 to 10000 steps")
        if not 0.0 <= self.loss <= 1.0:
            raise ParameterError("loss", self.loss, "0 to 1")


class Pilot:
    """Moves the hand of a session by one policy at a time, and changes policies without a jump of the hand.

    When a policy takes over, its places are shifted as :class:`~teleop_core.hand.operators.policy.HandOver` says. A
    person is a policy too, whose places come from a device. Places beyond the space of the hand are moved to its
    border.

    Args:
        session: Session whose hand is moved.
        policy: First policy.
        way: Way between policy and session.
        give_way: Largest speed at which a shift shrinks [m/s].

    Attributes:
        place: Place of the hand that was commanded last (3,) [m].
    """

    def __init__(self, session: Session, policy: Policy, way: Way | None = None, give_way: float = GIVE_WAY) -> None:
        self._session, self._way, self._hand_over = session, way or Way(), HandOver(give_way)
        self._policy, self.place = policy, np.zeros(3)
        self._rng = np.random.default_rng(self._way.seed)
        self._seen: deque[Observation] = deque(maxlen=self._way.seen_late + 1)
        self._told: deque[Array] = deque(maxlen=self._way.told_late + 1)
        self._time = -1.0

    def hand_over(self, policy: Policy) -> None:
        """Let another policy move the hand from the next step on."""
        self._policy = policy
        self._hand_over.begin()
        self._told.clear()

    def step(self, found: Observation) -> Observation:
        """Give an observation to the policy, command the hand, and let one step pass.

        Raises:
            ShapeError: The policy returned no place (3,).
            ParameterError: The place is not finite.
        """
        self._seen.append(found)
        wanted = checked_place(self._policy(self._seen[0]), ((3,),))
        passed = max(0.0, found.time - self._time) if self._time >= 0.0 else 0.0
        self._time = found.time
        self._told.append(self._hand_over.place(wanted, self.place, passed))
        if self._rng.random() >= self._way.loss:
            space = self._session.command_space
            self.place = np.clip(self._told[0], space.low[:3], space.high[:3])
        self._session.command(self.place)
        return self._session.step()


@dataclass(frozen=True, eq=False)
class NeuralNetwork:
    """A small policy: a network of one hidden layer that is trained on demonstrations.

    Attributes:
        weights: Weights and offsets of both layers.
        center: Mean of the inputs (k,).
        spread: Standard deviation of the inputs (k,).
        scale: Standard deviation of the outputs (m,).
    """

    weights: tuple[Array, Array, Array, Array]
    center: Array
    spread: Array
    scale: Array

    def __call__(self, inputs: Array) -> Array:
        """Outputs (m,) or (n, m) for inputs (k,) or (n, k)."""
        W, b, V, c = self.weights
        return np.asarray((np.tanh((inputs - self.center) / self.spread @ W + b) @ V + c) * self.scale)


def trained(inputs: Array, outputs: Array, *, hidden: int = 32, rounds: int = 2000, seed: int = 0) -> NeuralNetwork:
    """Network that imitates demonstrations, by Adam on the squared error (Kingma and Ba 2015, algorithm 1).

    Args:
        inputs: What was seen (n, k).
        outputs: What was done (n, m).
        hidden: Number of hidden units.
        rounds: Number of steps of Adam, each over all samples.
        seed: Seed of the first weights.
    """
    rng = np.random.default_rng(seed)
    center, spread, scale = inputs.mean(0), inputs.std(0) + 1e-9, outputs.std(0) + 1e-9
    X, Y = (inputs - center) / spread, outputs / scale
    sizes = [(X.shape[1], hidden), (hidden,), (hidden, Y.shape[1]), (Y.shape[1],)]
    P = [rng.standard_normal(size) / np.sqrt(size[0]) * (len(size) == 2) for size in sizes]
    first, second = ([np.zeros_like(part) for part in P] for _ in range(2))
    for step in range(1, rounds + 1):
        H = np.tanh(X @ P[0] + P[1])
        error = (H @ P[2] + P[3] - Y) * (2.0 / len(X))
        back = error @ P[2].T * (1.0 - H**2)
        slopes = (X.T @ back, back.sum(0), H.T @ error, error.sum(0))
        for k, slope in enumerate(slopes):
            first[k] += 0.1 * (slope - first[k])
            second[k] += 0.001 * (slope * slope - second[k])
            P[k] -= 0.01 * (first[k] / (1.0 - 0.9**step)) / (np.sqrt(second[k] / (1.0 - 0.999**step)) + 1e-8)
    return NeuralNetwork((P[0], P[1], P[2], P[3]), center, spread, scale)
