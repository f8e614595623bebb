"""Transfer: steps that bring a block from peg to peg, by one arm or two, and the judgement of each block.

A task's memory contains: the number of the block, -1 once all are done; the height above its start to which the block
is lifted; the numbers of blocks on another peg, and on no peg, when the attempt began; the initial positions of all
blocks; and the number of times that the block was picked up. The task's numbers are lift, width, longest, kind, x and y
of six displacements, clearance, tries.
"""

import math

from teleop_core.graph import topics
from teleop_core.hand.tasks import SCENE, attempts
from teleop_core.kernels import Array, inner

KINDS = ("one", "two", "hand_over")
"""Kinds of transfer: one arm moves all blocks; each arm moves every other block; the second arm takes blocks from the
first arm."""
STEPS = ("wait", "reach", "grasp", "lift", "meet", "take", "release", "retreat", "carry", "place")
"""Steps of an arm; a transfer with a hand-over uses the nine steps after the first one."""
(_WAIT, _REACH, _GRASP, _LIFT, _MEET, _TAKE, _RELEASE, _RETREAT, _CARRY, _PLACE) = range(len(STEPS))
_TWO, _HAND_OVER = KINDS.index("two"), KINDS.index("hand_over")
_STEP, _OVER = (topics.TASK_STATE.columns.index(name) for name in ("step", "is_over"))
_SECOND, _X0 = SCENE.index("is_second"), SCENE.index("x0")
_STARTS = 4
_TRIES = _STARTS + 3 * topics.JAW_OBJECTS
_MEETS = 0.01  # a block within this distance of the meeting point has reached it [m]
_RESTS = 5e-4  # a block that is no higher above its start rests on the table or on a peg [m]


@inner
def _verdict(numbers: Array, memory: Array, scene: Array, block: int) -> int:
    """:class:`Miss` of a block that came to rest at its present position; -1 if no block came to rest."""
    now, brought = _X0 + 3 * block, scene[_SECOND + 3] - memory[2]
    is_high = scene[now + 2] - memory[_STARTS + 3 * block + 2] > _RESTS
    if is_high or brought + scene[_SECOND + 4] - memory[3] == 0.0:
        return -1
    best, nearest = attempts.DROP, numbers[4 + 2 * topics.JAW_OBJECTS] + 1e-9
    for i in range(topics.JAW_OBJECTS):
        x = memory[_STARTS + 3 * i] + numbers[4 + 2 * i] - scene[now]
        y = memory[_STARTS + 3 * i + 1] + numbers[5 + 2 * i] - scene[now + 1]
        if brought > 0.0 and math.hypot(x, y) <= nearest:
            best = attempts.NONE if i == block else attempts.WRONG
    return best


@inner
def _begin_step(numbers: Array, memory: Array, scene: Array, state: Array, step: int) -> None:
    """Set the goal of a step, for the arm to which the scene belongs."""
    block, lift, width = max(int(memory[0]), 0), numbers[0], numbers[1]
    start, now = _STARTS + 3 * block, _X0 + 3 * block
    way_x, way_y = numbers[4 + 2 * block], numbers[5 + 2 * block]
    x, y, z = state[2], state[3], state[4]  # by default the tip does not move
    state[_STEP] = float(step)
    if step in (_REACH, _GRASP) or (step == _TAKE and scene[_SECOND] > 0.0):
        x, y, z = scene[now], scene[now + 1], scene[now + 2]
    elif step in (_LIFT, _RETREAT):
        x, y, z = memory[start], memory[start + 1], memory[start + 2] + lift
    elif step == _MEET:  # the second arm waits farther away, where it does not obstruct the first
        share = 1.0 if scene[_SECOND] > 0.0 else 0.5
        x, y = memory[start] + share * way_x, memory[start + 1] + share * way_y
        z = memory[start + 2] + lift
    elif step == _CARRY:  # bring the block above the peg, at any position in the jaw
        x = scene[1] + memory[start] + way_x - scene[now]
        y = scene[2] + memory[start + 1] + way_y - scene[now + 1]
        z = scene[3] + memory[start + 2] + memory[1] - scene[now + 2]
    is_closed = step in (_GRASP, _LIFT, _CARRY) or (step == _MEET and scene[_SECOND] == 0.0)
    is_closed = is_closed or step == _TAKE or (step == _RELEASE and scene[_SECOND] > 0.0)
    act = attempts.GRIP if is_closed else attempts.LET_GO
    if step == _REACH or (step == _MEET and scene[_SECOND] > 0.0):
        attempts.begin_goal(memory, scene, state, act, x, y, z, width)
    else:
        attempts.move_goal(state, act, x, y, z, width)


@inner
def _is_done(numbers: Array, memory: Array, scene: Array, state: Array) -> bool:
    """Whether the present step is done, judged by the grips of the jaws or by the tip's position."""
    step, is_second, block = int(state[_STEP]), scene[_SECOND] > 0.0, int(memory[0])
    grips, other = scene[_SECOND + 1] > 0.0, scene[_SECOND + 2] > 0.0
    if step == _MEET and is_second:  # the block has reached the meeting point
        away = 0.0
        for i in range(3):
            half = 0.5 * numbers[4 + 2 * block + i] if i < 2 else numbers[0]
            away += (scene[_X0 + 3 * block + i] - memory[_STARTS + 3 * block + i] - half) ** 2
        return other and math.sqrt(away) <= _MEETS
    if step == _RELEASE:
        return not (other if is_second else grips)
    if step in (_GRASP, _TAKE):
        return grips if step == _GRASP or is_second else other
    return step not in (_WAIT, _PLACE) and attempts.is_at_goal(scene, state)


@inner
def _next_step(numbers: Array, memory: Array, scene: Array, step: int) -> int:
    """Step after one that is done."""
    if step == _RETREAT:
        return _WAIT
    if step == _CARRY:  # first above the peg, then down
        is_above, memory[1] = memory[1] > 0.0, 0.0
        return _CARRY if is_above else _PLACE
    is_carried = step == _LIFT and int(numbers[3]) != _HAND_OVER
    if is_carried or (step == _RELEASE and scene[_SECOND] > 0.0):
        memory[1] = numbers[0]
        return _CARRY
    return step + 1


@inner
def _take_up(numbers: Array, memory: Array, scene: Array, state: Array) -> None:
    """Begin the transfer of the block that ``memory`` names, from its present position; wait if there is no block."""
    memory[2], memory[3] = scene[_SECOND + 3], scene[_SECOND + 4]
    begin = _MEET if int(numbers[3]) == _HAND_OVER and scene[_SECOND] > 0.0 else _REACH
    if memory[0] >= topics.JAW_OBJECTS or memory[_STARTS + 3 * int(memory[0])] == 0.0:
        memory[0], state[_OVER], begin = -1.0, 1.0, _WAIT
    _begin_step(numbers, memory, scene, state, begin)


@inner
def _next_block(numbers: Array, memory: Array, scene: Array, state: Array) -> None:
    """Begin the transfer of the next block; wait if no block is left."""
    stride = 2.0 if int(numbers[3]) == _TWO else 1.0
    first = 1.0 if stride == 2.0 and scene[_SECOND] > 0.0 else 0.0
    memory[0], memory[_TRIES] = (first if state[0] == 0.0 else memory[0] + stride), 1.0
    _take_up(numbers, memory, scene, state)


@inner
def _end_transfer(numbers: Array, memory: Array, scene: Array, state: Array, miss: int) -> None:
    """Count a transfer. Up to ``tries`` times, pick up a dropped block again, or continue with a late held block."""
    attempts.end_attempt(memory, scene, state, miss)
    is_held = scene[_SECOND + 1] + scene[_SECOND + 2] > 0.0
    goes_on = miss == attempts.DROP or (miss == attempts.LATE and is_held)
    if memory[_TRIES] >= numbers[5 + 2 * topics.JAW_OBJECTS] or not goes_on:
        _next_block(numbers, memory, scene, state)
        return
    memory[_TRIES] += 1.0
    if miss == attempts.DROP:
        _take_up(numbers, memory, scene, state)
    else:
        attempts.begin_goal(memory, scene, state, int(state[1]), state[2], state[3], state[4], numbers[1])


@inner
def lead(numbers: Array, memory: Array, scene: Array, state: Array) -> None:
    """Set the goals of an arm step by step, and judge its block when it comes to rest; see a task's judge."""
    if state[0] == 0.0:
        for i in range(3 * topics.JAW_OBJECTS):
            memory[_STARTS + i] = scene[_X0 + i]
        _next_block(numbers, memory, scene, state)
    if memory[0] < 0.0:
        return
    step, block, miss = int(state[_STEP]), int(memory[0]), -1
    is_others = int(numbers[3]) == _HAND_OVER and scene[_SECOND + 2] > 0.0
    if scene[_SECOND + 1] == 0.0 and not is_others and (step > _LIFT or step == _WAIT):
        miss = _verdict(numbers, memory, scene, block)
    if miss < 0 and attempts.waited(memory, scene) > numbers[2]:
        miss = attempts.LATE
    if miss >= 0:
        _end_transfer(numbers, memory, scene, state, miss)
        return
    if step == _TAKE and scene[_SECOND] > 0.0:  # because a hand is never quite still
        for i in range(3):
            state[2 + i] = scene[_X0 + 3 * block + i]
    if _is_done(numbers, memory, scene, state):
        _begin_step(numbers, memory, scene, state, _next_step(numbers, memory, scene, step))
