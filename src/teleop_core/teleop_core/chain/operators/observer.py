"""Observer: an operator who looks at the slave, plans from what it saw, moves, and looks again.

Each look-move cycle is one submovement towards the goal of a task, with the noise of a fast hand. Its end is seen as
late as display, network and eye make it, and only then the next one begins. So a delay slows it down by its share of
the cycle, and nothing in here knows how long the delay is. Where the constants come from stands in ``docs/tasks.md``.
"""

import math
from collections import deque
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from teleop_core.base import parameter
from teleop_core.chain.mapping.parameters import axis_map
from teleop_core.chain.operators import Operator, Setting
from teleop_core.chain.operators.shapes import minimum_jerk
from teleop_core.chain.tasks import Act
from teleop_core.graph import STATE, topics
from teleop_core.kernels import Array, dot, length, product

AHEAD = 16
"""Ticks for which it is asked at once, about a frame: the eye needs longer, so nothing is late."""
_GAIN = STATE["gain"]
_NUMBER, _ACT, _GOAL, _WIDTH = (topics.TASK_STATE.columns.index(name) for name in ("number", "act", "goal_x", "width"))
_PRESS_TIME = 0.06  # for which the hand stays closed [s]
_STILL_TIME, _STILL = 0.02, 0.05  # at rest: in this time [s] it goes this share of its way
_SHORTEST = 0.1  # of a width: a way that is not worth a submovement
_FITTED = "fitted: to the four times of movement of MacKenzie and Ware 1993"


@dataclass(frozen=True, kw_only=True)
class ObserverParameters:
    """How the operator sees, waits and moves."""

    eye: float = parameter(
        0.13,
        unit="s",
        lower=0.0,
        upper=1.0,
        fixed=True,
        doc="from when something is on the screen to when a plan can use it",
        source="published: 0.110 to 0.163 s in six studies of corrections by sight",
    )
    reaction: float = parameter(
        0.25, unit="s", lower=0.0, upper=2.0, fixed=True, doc="from a new goal to the first submovement", source=_FITTED
    )
    least_time: float = parameter(
        0.06,
        unit="s",
        lower=0.02,
        upper=1.0,
        fixed=True,
        doc="duration of a submovement of no difficulty",
        source=_FITTED,
    )
    time_per_bit: float = parameter(
        0.02, unit="s", lower=0.0, upper=1.0, fixed=True, doc="what each bit of difficulty adds to it", source=_FITTED
    )
    noise: float = parameter(
        0.04,
        unit="s",
        lower=0.0,
        upper=0.5,
        fixed=True,
        doc="standard deviation of a submovement's end along its way, per mean speed",
        source=_FITTED + "; linear in speed: Meyer et al. 1988",
    )
    noise_across: float = parameter(
        0.36,
        lower=0.0,
        upper=1.0,
        fixed=True,
        doc="the same across its way, per that along it",
        source="assumed: as of the operator human",
    )
    error_cost: float = parameter(
        0.0,
        unit="s",
        lower=0.0,
        upper=100.0,
        off=0.0,
        fixed=True,
        doc="time that an error costs: it presses unseen where that is worth the wait; 0: never",
    )
    fastest: float = parameter(
        0.04,
        unit="m/s",
        lower=0.005,
        upper=10.0,
        fixed=True,
        doc="largest mean speed of a submovement of the hand; its peak is 1.9 times that",
        source="fitted: 95 % at 65 mm/s while it moves, UVA-DSA telesurgery QoS analysis 2026",
    )
    longest_wait: float = parameter(
        3.0,
        unit="s",
        lower=0.1,
        upper=60.0,
        fixed=True,
        doc="after which it goes on, though its last motion did not show; less once it knows how late a motion shows",
        source="assumed: as the longest outage of the UVA-DSA telesurgery QoS analysis 2026",
    )
    axes: tuple[str, ...] = parameter(
        ("-z", "-x", "+y"), length=3, fixed=True, doc="axes of the hand along x, y, z of the slave, as motion_scaling's"
    )


class _Glance(NamedTuple):
    """What is on the screen at a time [s]: tip and goal (3,) [m]."""

    time: float
    tip: Array
    goal: Array


class _Move(NamedTuple):
    """A submovement: its begin and duration [s], and where the hand goes (3,) [m]."""

    begin: float
    duration: float
    start: Array
    step: Array
    tip: Array  # where the tip was seen when it began
    way: Array  # that the tip is to go by it, as the hand feels


class Observer:
    """Motion of one session: it reads what is seen at the time that it is asked.

    Args:
        p: Its constants.
        setting: What it is made with; ``seen`` must have a task.
    """

    def __init__(self, p: ObserverParameters, setting: Setting) -> None:
        seen = setting.seen
        assert seen is not None
        self._p, self._seen = p, seen
        self._hand_of_slave = axis_map("operator.observer.axes", p.axes).T
        self._rng = np.random.default_rng((setting.seed, 3))
        self._glances: deque[_Glance] = deque()
        self._place = np.zeros(3)  # of the hand, where the last submovement ends
        self._move: _Move | None = None
        self._number = 0.0
        self._next = 0.0  # when it may move again, whatever it sees [s]
        self._half_seen = math.inf  # when half of the last way was seen [s]
        self._is_still = False  # whether its end was seen
        self._close = -math.inf  # when the hand closes, and for a moment [s]
        self._holds, self._turn = False, -math.inf  # whether the hand stays closed, and since when
        self._lag = -1.0  # how late the last motion was seen, beside the eye [s]; < 0: not known

    def __call__(self, times: Array) -> Array:
        """Rows (N, 13) of :data:`~teleop_core.chain.operators.Motion` for times (N,) [s]."""
        now, until = float(times[0]), float(times[-1])
        self._look(now)
        rows = np.zeros((len(times), 13))
        self._draw(times, rows)
        if self._seen.task[_NUMBER] > 0.0 and self._glances and self._decide(now, until):
            self._draw(times, rows)
        is_pressing = (times >= self._close) & (times < self._close + _PRESS_TIME)
        rows[:, 12] = is_pressing | np.where(times >= self._turn, self._holds, not self._holds)
        return rows

    def _draw(self, times: Array, rows: Array) -> None:
        """Write the present submovement, from its begin on."""
        if (move := self._move) is not None:
            share = minimum_jerk((times - move.begin) / move.duration)
            moved = move.start + share[:, None] * move.step
            rows[:, :3] = np.where((times >= move.begin)[:, None], moved, rows[:, :3])

    def _look(self, now: float) -> None:
        """Keep what is on the screen, and forget what the eye has long seen."""
        seen, glances = self._seen, self._glances
        if seen.slave[:3].any():  # else it has not been shown yet
            goal = seen.task[_GOAL : _GOAL + 3].copy()
            glances.append(_Glance(now, seen.slave[:3].copy(), goal))
        while len(glances) > 2 and glances[1].time <= now - self._p.eye - _STILL_TIME:
            glances.popleft()

    def _glance(self, when: float) -> _Glance:
        """What the eye can use at a time [s]: what was on the screen, between two looks."""
        at, glances = when - self._p.eye, self._glances
        later = next((i for i, glance in enumerate(glances) if glance.time > at), len(glances))
        if later == 0 or later == len(glances):
            return glances[min(later, len(glances) - 1)]
        a, b = glances[later - 1], glances[later]
        share = (at - a.time) / (b.time - a.time)
        return _Glance(at, a.tip + share * (b.tip - a.tip), a.goal + share * (b.goal - a.goal))

    def _decide(self, now: float, until: float) -> bool:
        """Begin the next submovement, or press, if the time for either comes until then.

        Returns:
            Whether it begins a submovement.
        """
        p, task = self._p, self._seen.task
        width, act = float(task[_WIDTH]), int(task[_ACT])
        if task[_NUMBER] != self._number and act != Act.PASS:
            self._number = float(task[_NUMBER])
            self._next = now + p.reaction
        when = max(self._next, self._seen_at(until), now)
        if when > until:
            return False
        glance = self._glance(when)
        goal = glance.goal if act == Act.PASS else task[_GOAL : _GOAL + 3]
        way = goal - glance.tip
        if act == Act.PASS:
            way = way + self._speed_of_goal() * (p.eye + p.least_time)
        distance = float(length(way))
        if act != Act.PASS and distance <= 0.5 * width:
            self._press(when, act)
        elif distance > _SHORTEST * width:
            self._begin(when, glance.tip, way, distance, width, act)
            return True
        return False

    def _seen_at(self, until: float) -> float:
        """When the end of the last submovement is seen [s]; infinite if not until then.

        It is seen as long after half of the way was, as the hand took from there to the end; a
        slower arm is seen to move on.
        """
        move = self._move
        if move is None:
            return -math.inf
        if math.isinf(self._half_seen):
            self._half_seen = self._half_way(move, until)
        if math.isinf(self._half_seen):
            late = move.begin + move.duration + self._patience()
            return late if late <= until else math.inf
        when = self._half_seen + 0.5 * move.duration
        if when > until or self._is_still:
            return when
        gone = float(length(self._glance(when + _STILL_TIME).tip - self._glance(when).tip))
        self._is_still = gone <= _STILL * float(length(move.way))
        if not self._is_still:  # it still moves: half of it is seen later
            self._half_seen += until - when + 1e-3
            return math.inf
        return when

    def _half_way(self, move: _Move, until: float) -> float:
        """When the tip was seen half way [s]; infinite if it was not until then."""
        whole = float(dot(move.way, move.way))
        before: tuple[float, float] | None = None
        for glance in self._glances:
            if glance.time < move.begin:
                continue
            if glance.time > until - self._p.eye:
                break
            gone = float(dot(glance.tip - move.tip, move.way)) / whole
            if gone >= 0.5:
                at = glance.time
                if before is not None and gone > before[1]:
                    share = (0.5 - before[1]) / (gone - before[1])
                    at = before[0] + share * (at - before[0])
                late = at - move.begin - 0.5 * move.duration
                self._lag = max(late, 0.0)
                return at + self._p.eye
            before = (glance.time, gone)
        return math.inf

    def _patience(self) -> float:
        """How long after its end a motion that does not show is waited for [s]."""
        p = self._p
        if self._lag < 0.0:
            return p.longest_wait
        return min(p.longest_wait, p.eye + 1.5 * self._lag + p.reaction)

    def _begin(self, now: float, tip: Array, way: Array, distance: float, width: float, act: int) -> None:
        """Begin a submovement along a way of the tip (3,) [m], as long as it is."""
        p = self._p
        gain = float(self._seen.state[_GAIN]) or 1.0
        duration = p.least_time + p.time_per_bit * math.log2(distance / width + 1.0)
        duration = max(duration, distance / gain / p.fastest)
        spread = p.noise * distance / duration
        along, noise = way / distance, self._rng.standard_normal(3)
        ahead = along * float(dot(along, noise))
        ended = way + spread * (ahead + p.noise_across * (noise - ahead))
        step = product(self._hand_of_slave, ended) / gain
        self._move = _Move(now, duration, self._place, step, tip, ended)
        self._place = self._place + step
        self._next, self._half_seen, self._is_still = now + duration, math.inf, False
        missed = math.erfc(0.5 * width / (math.sqrt(2.0) * max(spread, 1e-12)))
        if act == Act.PRESS and missed * p.error_cost < max(self._lag, 0.0) + p.eye and p.error_cost > 0.0:
            self._press(now + duration, act)

    def _press(self, when: float, act: int) -> None:
        """Close or open the hand at a time [s]; a press waits for another goal."""
        if act == Act.PRESS:
            self._close, self._next = when, math.inf
        elif self._holds != (act == Act.GRIP):
            self._holds, self._turn = act == Act.GRIP, when

    def _speed_of_goal(self) -> Array:
        """Velocity of the goal (3,) [m/s] as it is seen, since it last jumped to another place."""
        glances = self._glances
        first = last = glances[-1]
        for glance in reversed(glances):
            if float(length(first.goal - glance.goal)) > self._seen.task[_WIDTH]:
                break
            first = glance
        return (last.goal - first.goal) / max(last.time - first.time, 1e-9)


OBSERVER = Operator("observer", Observer, ObserverParameters, ahead=AHEAD, needs=("task",))
