"""Observer: an operator who looks at the slave, plans from what it saw, moves, and looks again.

Each look-move cycle is one submovement towards the goal of a task, with the noise of a fast hand. The next submovement
begins only after the operator has seen the end of the last one. Display, network and eye delay this moment. So a delay
lengthens each cycle, although the operator does not know the length of the delay. Contact is felt without the delay of
the display. The sources of the constants are in ``docs/tasks.md``.
"""

import math

import numpy as np

from teleop_core.graph import STATE, topics
from teleop_core.hand.operators import Operator, Setting
from teleop_core.hand.operators.glances import SETTLED_TIME, STILL_TIME, Glance, Glances, crossing
from teleop_core.hand.operators.hand_room import HandRoom, TurnsOfHand, turned
from teleop_core.hand.operators.observer_parameters import ObserverParameters
from teleop_core.hand.operators.submovement import (
    PRESS_TIME,
    SURE,
    Doubt,
    Move,
    Way,
    careful_time,
    chance_inside,
    draw,
    end_noise,
)
from teleop_core.hand.tasks import Act
from teleop_core.kernels import Array, dot, length, product
from teleop_core.kernels.axes import axis_map

AHEAD = 16
"""Number of ticks per request of the motion, about one frame; the delay of the eye is longer, so this adds no delay."""
_COLUMNS = ("number", "act", "goal_x", "width", "goal_qw", "turn", "force")
_NUMBER, _ACT, _GOAL, _WIDTH, _ATTITUDE, _TURN, _FORCE = map(topics.TASK_STATE.columns.index, _COLUMNS)
_ENDS = (topics.Limit.JOINT, topics.Limit.WORKSPACE)
_STILL = 0.05  # a tip that moves less than this share of its path in STILL_TIME is at rest
_SAME = 0.02  # a tip is where the hand felt it end up to this share of its path, or a quarter of the goal's width
_SHORTEST = 0.1  # displacements shorter than this share of a goal's width need no submovement
_FELT = 0.03  # least force that is felt [N]
_LEAST_SHARE = 0.1  # share of a submovement that a hand at the end of its room tries all the same


class Observer:
    """Motion of one session; each call reads the data that are seen at that time.

    Args:
        p: Constants of the operator.
        setting: Setting of the operator; ``seen`` must have a task.
    """

    def __init__(self, p: ObserverParameters, setting: Setting) -> None:
        seen = setting.seen
        assert seen is not None
        self._p, self._seen = p, seen
        self._hand_of_slave = axis_map("operator.observer.axes", p.axes).T
        self._turns_of_hand = TurnsOfHand(self._hand_of_slave, p.tool_axes)
        self._room = HandRoom(setting.common.device.corners, p.largest_turn)
        self._rng = np.random.default_rng((setting.seed, 3))
        self._glances = Glances(p.eye)
        self._hand = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])  # pose at which the last submovement ends
        self._softness = p.softness  # last felt compliance: displacement per newton [m/N]
        self._move: Move | None = None
        self._has_tried = False  # whether a submovement to the present goal was made
        self._turns = False  # whether the last submovement turns the stylus
        self._number = 0.0
        self._next = 0.0  # time before which the operator does not move [s]
        self._half_seen = math.inf  # time at which half of the last motion was seen [s]
        self._sooner = math.inf  # time at which half of a motion was seen, too soon for the believed lag [s]
        self._before: Glance | None = None  # what was seen before the last motion could be seen, if the lag is long
        self._is_still = self._was_felt = False  # whether the end of the last motion was seen; whether it was only felt
        self._close = -math.inf  # time at which the hand closes for a moment [s]
        self._holds, self._since = False, -math.inf  # whether the hand stays closed, and since which time [s]
        self._lag = -1.0  # delay with which the last motion was seen, without the eye's delay [s]; < 0: not known
        self._doubt: Doubt = SURE  # of the seen place of the tip

    def __call__(self, times: Array) -> Array:
        """Rows (N, 13) of :data:`~teleop_core.hand.operators.Motion` for times (N,) [s]."""
        now, until = float(times[0]), float(times[-1])
        self._glances.take(now, self._seen, self._seen.task[_GOAL : _GOAL + 3])
        rows = np.zeros((len(times), 13))
        draw(self._move, self._turns, times, rows)
        if self._seen.task[_NUMBER] > 0.0 and self._glances and self._decide(now, until):
            draw(self._move, self._turns, times, rows)
        if now < self._since <= until:
            rows[:, 12] = (times >= self._since) == self._holds
        else:
            rows[:, 12] = (now >= self._since) == self._holds
        if self._close <= until and now < self._close + PRESS_TIME:
            rows[(times >= self._close) & (times < self._close + PRESS_TIME), 12] = 1.0
        return rows

    def _decide(self, now: float, until: float) -> bool:
        """Begin the next submovement or press, if it is due before ``until``.

        Returns:
            Whether a submovement begins.
        """
        p, task = self._p, self._seen.task
        width, act = float(task[_WIDTH]), int(task[_ACT])
        if task[_NUMBER] != self._number and act != Act.PASS:
            self._number = float(task[_NUMBER])
            self._next, self._doubt, self._has_tried = now + p.reaction, SURE, False
        when = max(self._next, self._seen_at(until), now)
        if when > until:
            return False
        glance = self._glances.at(when)
        way = self._way(glance)
        off, turn = float(length(way.step)), float(length(way.turn))
        if act != Act.PASS and self._is_worth_it(off, turn):
            self._press(when, act)
        elif off > _SHORTEST * width or turn > _SHORTEST * task[_TURN] or abs(way.missing) > _SHORTEST:
            lag = max(self._lag, 0.0)
            ahead = self._way_of_goal(lag + self._time_of_look()) - self._way_of_goal(lag)
            gone = float(length(self._glances.speed_of_goal(width))) * self._time_of_look()
            # On the way to a goal that moves nothing is left on purpose.
            runs = act in (Act.PRESS, Act.PASS) and gone > 0.25 * width
            whole = 1.0 / (1.0 - self._p.undershoot) if runs else 1.0
            self._begin(when, glance, way._replace(step=whole * (way.step + ahead)))
            return True
        elif act != Act.PASS:  # inside, but not sure: look again
            self._next, self._doubt = when + self._time_of_look(), SURE
        return False

    def _is_worth_it(self, off: float, turn: float) -> bool:
        """Whether to press now, believed ``off`` [m] and ``turn`` [rad] beside the goal, rather than to look again."""
        p, task, doubt, width = self._p, self._seen.task, self._doubt, float(self._seen.task[_WIDTH])
        extrapolated = p.noise / p.least_time * float(length(self._way_of_goal(self._time_of_look())))
        if off > 0.5 * width and not (self._has_tried and extrapolated > 0.0):  # only a goal that runs away is given up
            return False
        chance = chance_inside(off, math.hypot(doubt.spread, extrapolated), width)
        later = chance_inside(0.0, extrapolated, width)  # 1 for a goal at rest
        if task[_TURN] > 0.0:
            chance *= chance_inside(turn, doubt.turn_spread, float(task[_TURN]))
        return (later - chance) * p.error_cost < self._time_of_look()

    def _time_of_look(self) -> float:
        """Time of another submovement and of seeing its end [s]; a lag that is not known yet counts as none."""
        return self._p.least_time + max(self._lag, 0.0) + self._p.eye

    def _way_of_goal(self, time: float) -> Array:
        """Way (3,) [m] of a goal to press that moves; a goal of the jaw counts as at rest."""
        if int(self._seen.task[_ACT]) != Act.PRESS:
            return np.zeros(3)
        return self._glances.way_of_goal(float(self._seen.task[_WIDTH]), time)

    def _way(self, glance: Glance) -> Way:
        """The motion to be made, from the data seen and, during a press, from the force felt."""
        p, task, turn, lever, missing = self._p, self._seen.task, np.zeros(3), 0.0, 0.0
        is_moving = int(task[_ACT]) == Act.PASS
        goal = glance.goal if is_moving else task[_GOAL : _GOAL + 3]
        step = goal - glance.tip[:3] + self._doubt.place
        if is_moving:
            step = step + self._glances.speed_of_goal(float(task[_WIDTH])) * (p.eye + p.least_time)
        else:
            step = step + self._way_of_goal(max(self._lag, 0.0))
        if task[_TURN] > 0.0:
            turn = self._turns_of_hand.of_tip(glance.tip[3:], task[_ATTITUDE : _ATTITUDE + 4]) + self._doubt.turn
            lever = float(task[_WIDTH] / task[_TURN])
        felt = float(length(glance.force))
        if task[_FORCE] > 0.0 and felt >= _FELT:
            self._feel_softness(felt)
            out = product(self._hand_of_slave.T, glance.force) / felt
            step = step - float(dot(step, out)) * out
            aside = 1.0 if length(step) > 0.5 * task[_WIDTH] else 0.0
            step = aside * step - (task[_FORCE] - felt) * self._softness * out
            missing = 1.0 - felt / float(task[_FORCE])
        return Way(step, turn, lever, missing)

    def _feel_softness(self, felt: float) -> None:
        """Learn the compliance [m/N] from the last submovement; it changes by a factor of three at most."""
        if (move := self._move) is None or length(move.seen.force) < _FELT:
            return
        more, pressed = felt - float(length(move.seen.force)), self._pressed(move)
        if abs(more) >= _FELT and more * pressed > 0.0:
            self._softness *= min(max(pressed / more / self._softness, 1.0 / 3.0), 3.0)

    def _pressed(self, move: Move) -> float:
        """Displacement of a submovement against the force that was felt before it [m]."""
        force = move.seen.force
        return -float(dot(product(self._hand_of_slave, move.way.step), force)) / max(float(length(force)), _FELT)

    def _seen_at(self, until: float) -> float:
        """Time at which the end of the last submovement is seen or felt [s]; infinite if it is after ``until``.

        From the time at which half of the motion was seen, the operator expects the end after the time that the hand
        took from half to end. If the arm is slower, the operator sees that it still moves.
        """
        move = self._move
        if move is None or move.is_clutched:  # no submovement begins while the arm is seen to move to its start
            return -math.inf if move is not None or self._is_at_rest(until) else math.inf
        end = move.begin + move.duration
        is_pressed = self._seen.task[_FORCE] > 0.0 and length(move.seen.force) >= _FELT
        self._was_felt = bool(is_pressed and self._is_felt(move, end + self._p.eye, until))
        if self._was_felt:
            return end + self._p.eye
        if math.isinf(self._half_seen) and not is_pressed:
            self._half_seen = self._half_way(move, until)
        if math.isinf(self._half_seen):
            return self._given_up(move, until)
        when = self._half_seen + 0.5 * move.duration
        if when > until or self._is_still:
            return when
        self._is_still = self._has_ended(move, when)
        if not self._is_still:  # the tip still moves: the half is seen later
            self._half_seen += until - when + 1e-3
            return math.inf
        return when

    def _given_up(self, move: Move, until: float) -> float:
        """Time at which the operator goes on without having seen a motion [s]; infinite if it is after ``until``.

        The screen is then believed to be as late as that at least, unless the arm is at its end. A short motion may as
        well have been stopped by friction or contact.
        """
        late = move.begin + move.duration + self._patience()
        if late > until:
            return math.inf
        if not (self._has_stopped or self._is_short(move)):
            self._lag = max(self._lag, late - self._p.eye - move.begin - 0.5 * move.duration)
        return late

    def _is_short(self, move: Move) -> bool:
        """Whether a motion is shorter than the goal is wide, so that the rest of another motion may look like it."""
        return bool(length(move.way.both) < self._seen.task[_WIDTH])

    @property
    def _has_stopped(self) -> bool:
        """Whether the arm is seen at the end of its range."""
        return bool(self._seen.state[STATE["limit"]] in _ENDS)

    def _has_ended(self, move: Move, when: float) -> bool:
        """Whether a motion is seen at rest at a time [s]: for longer, if it is not where the hand felt it end.

        An arm that overshoots stands still for a moment at its farthest point, and a frame that stands shows no motion.
        """
        path, width = float(length(move.way.both)), float(self._seen.task[_WIDTH])
        now, most = self._glances.at(when), _STILL * path
        if length(self._gone(now, self._glances.at(when + STILL_TIME))) > most:
            return False
        beyond = float(dot(self._gone(move.seen, now) - move.unseen, move.unseen)) / float(length(move.unseen))
        if abs(beyond) <= max(0.25 * width, _SAME * path):
            return True
        if length(self._gone(now._replace(tip=now.before), now)) > most:
            return False
        return bool(length(self._gone(self._glances.at(when - SETTLED_TIME), now)) <= most)

    def _is_at_rest(self, until: float) -> bool:
        """Whether the operator recently saw the tip at rest."""
        gone = self._gone(self._glances.at(until - STILL_TIME), self._glances.at(until))
        is_seen = self._glances.covers(until - STILL_TIME)
        return is_seen and bool(length(gone) <= _STILL * self._seen.task[_WIDTH])

    def _is_felt(self, move: Move, when: float, until: float) -> bool:
        """Whether the force at rest already shows the result of a submovement, and not the force before it."""
        if when > until:
            return False
        still = _STILL * float(self._seen.task[_FORCE])
        felt, later = (float(length(self._glances.at(time).force)) for time in (until - STILL_TIME, until))
        expected = self._pressed(move) / self._softness
        more = (felt - float(length(move.seen.force))) * math.copysign(1.0, expected)
        return more >= min(0.5 * abs(expected), _FELT) - still and abs(later - felt) <= still

    def _gone(self, a: Glance, b: Glance) -> Array:
        """Displacement and weighted rotation (6,) [m] between two glances, weighted as in the present submovement."""
        turn, lever = np.zeros(3), 0.0 if self._move is None else self._move.way.lever
        if lever > 0.0:
            turn = self._turns_of_hand.of_tip(a.tip[3:], b.tip[3:])
        return np.concatenate((b.tip[:3] - a.tip[:3], lever * turn))

    def _half_way(self, move: Move, until: float) -> float:
        """Time at which the tip was seen at half of the path [s]; infinite if this was not before ``until``.

        What is seen before half of a long lag is the rest of an earlier motion, unless nothing is seen later.
        """
        at, soonest = self._passes_half(move, move.seen, move.begin, until), move.begin + 0.5 * self._lag
        if soonest > move.begin + self._p.eye and np.array_equal(move.unseen, move.way.both):
            self._sooner = min(self._sooner, at)
            if until < soonest + self._p.eye:
                return math.inf
            self._before = self._before or self._glances.at(soonest + self._p.eye)
            at = self._passes_half(move, self._before, soonest, until)
            if math.isinf(at) and until >= move.begin + move.duration + self._patience():
                if self._is_short(move):
                    return self._sooner + self._p.eye
                at = max(self._sooner, soonest + 0.5 * move.duration)  # so the believed lag becomes half
        if math.isinf(at):
            return at
        self._lag = max(at - move.begin - 0.5 * move.duration, 0.0)
        return at + self._p.eye

    def _passes_half(self, move: Move, before: Glance, begin: float, until: float) -> float:
        """Time on the screen, from ``begin`` [s] on, at which the tip has passed half of a path since ``before``."""
        unseen, whole = move.unseen, float(dot(move.unseen, move.unseen))
        half = 1.0 - 0.5 * float(length(move.way.both)) / math.sqrt(whole)
        gone = [
            (glance.time, float(dot(self._gone(before, glance), unseen)) / whole)
            for glance in self._glances.since(begin, until)
        ]
        return crossing(gone, half)

    def _patience(self) -> float:
        """Time for which the operator waits, after the end of a motion, until the motion becomes visible [s]."""
        p = self._p
        if self._lag < 0.0:
            return p.longest_wait
        return min(p.longest_wait, 2.0 * p.eye + 1.5 * self._lag + p.least_time)

    def _is_unseen(self, move: Move, seen: Glance) -> bool:
        """Whether the operator gave up waiting for a motion of which nothing was seen: it may still be seen later."""
        is_given_up = math.isinf(self._half_seen) and not (move.is_clutched or self._has_stopped)
        return is_given_up and bool(length(self._gone(move.seen, seen)) <= _STILL * length(move.unseen))

    def _begin(self, now: float, seen: Glance, way: Way) -> None:
        """Begin a submovement; bring the hand back instead if the hand or the arm is at the end of its range."""
        p = self._p
        gain = float(self._seen.state[STATE["gain"]]) or 1.0
        step = product(self._hand_of_slave, way.step) / gain
        turn = self._turns_of_hand.of_hand(way.turn, self._hand[3:]) if way.turn.any() else way.turn
        was_back, fits = self._move is not None and self._move.is_clutched, self._room.share(self._hand, step, turn)
        has_stopped = self._has_stopped and self._move is not None
        if ((has_stopped and math.isinf(self._half_seen)) or fits < 1.0) and not was_back:
            self._bring_back(now, seen, *(fits < 1.0) * np.stack((step, turn)))
            return
        fits = max(fits, _LEAST_SHARE)
        share = min(fits, 1.0 - p.undershoot) if way.missing == 0.0 else fits
        way = Way(share * way.step, share * way.turn, way.lever)
        distance, angle = float(length(way.step)), float(length(way.turn))
        duration = max(p.least_time, distance / gain / p.fastest, angle / p.fastest_turn)
        duration = max(duration, careful_time(p, self._seen, seen.tip[:3], way.step))
        ended = Way(
            way.step + end_noise(p, self._rng, way.step, duration),
            way.turn + end_noise(p, self._rng, way.turn, duration),
            way.lever,
        )
        step = product(self._hand_of_slave, ended.step) / gain
        turn = self._turns_of_hand.of_hand(ended.turn, self._hand[3:]) if angle else way.turn
        fits = max(self._room.share(self._hand, step, turn), _LEAST_SHARE)  # noise may lead beyond the room
        ended = Way(fits * ended.step, fits * ended.turn, way.lever)
        unseen = ended.both
        if self._move is not None and (self._was_felt or self._is_unseen(self._move, seen)):
            seen, unseen = seen._replace(tip=self._move.seen.tip), unseen + self._move.unseen
        self._go(Move(now, duration, self._hand, fits * step, fits * turn, seen, ended, unseen))
        self._has_tried = True
        # As uncertain as the movement itself: the operator decides before it has seen all of the end.
        spread = p.noise / duration
        doubts = end_noise(p, self._rng, way.step, duration), end_noise(p, self._rng, way.turn, duration)
        self._doubt = Doubt(*doubts, spread * distance, spread * angle)

    def _bring_back(self, now: float, seen: Glance, step: Array, turn: Array) -> None:
        """Clutch, and bring the hand to the pose with most room for a step (3,) [m] and a turn (3,) [rad]."""
        p = self._p
        way, angle = self._room.back(self._hand, step, turn)
        duration = max(p.least_time, float(length(way)) / p.fastest, float(length(angle)) / p.fastest_turn)
        nothing = Way(np.zeros(3), np.zeros(3), 0.0)
        self._go(Move(now + PRESS_TIME, duration, self._hand, way, angle, seen, nothing, nothing.both, True))
        self._next += 2.0 * PRESS_TIME

    def _go(self, move: Move) -> None:
        """Store a submovement as the present one."""
        self._move, self._turns = move, bool(move.turn.any() or move.start[4:].any())
        self._hand = np.concatenate((move.start[:3] + move.step, turned(move.start[3:], move.turn)[0]))
        self._next, self._half_seen = move.begin + move.duration, math.inf
        self._sooner, self._before = math.inf, None
        self._is_still = self._was_felt = False

    def _press(self, when: float, act: int) -> None:
        """Close or open the hand at the time ``when`` [s]; after a press the operator waits for the next goal."""
        if act == Act.PRESS:
            self._close, self._next = when, math.inf
        elif self._holds != (act == Act.GRIP):
            self._holds, self._since = act == Act.GRIP, when


OBSERVER = Operator("observer", Observer, ObserverParameters, ahead=AHEAD, needs=("task",))
