"""Exercises with messages that are lost, late, out of order, implausible, forged, malformed, or too many."""

import math
from functools import partial

import numpy as np

from teleop_core.graph.operation import State
from teleop_core.graph.topics import (
    MASTER_BUTTONS,
    MASTER_MEASURED_CP,
    SLAVE_SERVO_JP,
    SLAVE_SETPOINT_JS,
    TELEOP_STATE,
    Topic,
)
from teleop_core.slave.operation import Fault
from teleop_drill.drill import hand
from teleop_drill.drill.exercise import AllowedMotion, Cure, Exercise, Rig, Time, after, never, outage
from teleop_drill.drill.hand import Distortion

_FOR = 1.0  # duration of the disturbance of a stream [s]
_AHEAD_NS = 2_000_000_000
_WATCH = 0.5  # time of observation after the disturbance, for an arm that keeps moving [s]
_SLOW = 0.05  # speed limit of the tool while the hand shakes [m/s]
_SHAKE = 0.02  # amplitude of a hand that shakes [m]
_SHAKES = 3.0  # frequency of a hand that shakes [Hz]
_PRESS = 1.0  # duration of the motion of a joint to its limit [s]
_STAY = 1.5  # time for which the joint is pressed into the limit [s]
_GAP = 0.08  # gap in the hand's samples, shorter than the command timeout [s]
_NAMED = 0.05  # speed of a joint that is driven by its name [rad/s or m/s]
_TURN = 1.0  # angle by which the hand turns at once [rad]
_SHARE = 0.5  # speed of the tip during the motion to the limit, divided by the hand's speed
_SHAKEN = hand.SPEED + 2.0 * math.pi * _SHAKE * _SHAKES


def _distort(distortion: Distortion, rig: Rig, seconds: float = _FOR) -> None:
    rig.mark()
    rig.distort(distortion)
    rig.wait(seconds)


def _straighten(rig: Rig) -> None:
    rig.distort(hand.faithful)


def _disturbed(
    name: str,
    text: str,
    distortion: Distortion,
    *,
    motion: AllowedMotion = AllowedMotion.GOES_ON,
    stands: Time = never,
    warns: bool = False,
) -> Exercise:
    """Exercise with distorted samples of the hand.

    The arm follows, or stays at its position as with the clutch pressed.
    """
    is_going = motion is AllowedMotion.GOES_ON
    return Exercise(
        name=name,
        text=text,
        inject=partial(_distort, distortion),
        undo=_straighten,
        motion=motion,
        stands=stands,
        warns=warns,
        watch=_WATCH if is_going else 0.0,
    )


def _shake(rig: Rig) -> None:
    """Move the hand far faster than the speed limit of the tool."""
    rig.set("slave", "operation.tool_speed", _SLOW)
    rig.mark()
    rig.distort(hand.shaken(_SHAKE, _SHAKES))
    rig.wait(_FOR)


def _calm(rig: Rig) -> None:
    rig.distort(hand.faithful)
    rig.wait(0.5)
    rig.set("slave", "operation.tool_speed", 0.0)


def _press_limit(rig: Rig) -> None:
    """Drive a joint to its limit, press into the limit for some time, and drive the joint back."""
    rig.distort(hand.silent)
    rig.wait(0.3)  # wait until other clients may drive the arm
    ways, tip = rig.way_to_limit()
    seconds = max(_PRESS, tip / (_SHARE * hand.SPEED))
    speeds = ways / seconds
    rig.drive(speeds, seconds - _PRESS)  # a longer distance is driven with the tip at the hand's speed
    rig.mark()
    rig.drive(speeds, _PRESS + _STAY)
    rig.drive(-speeds, _PRESS)
    rig.wait(0.3)


def _mute(rig: Rig) -> None:
    rig.mark()
    rig.mute_buttons(is_mute=True)
    rig.wait(1.5)


def _unmute(rig: Rig) -> None:
    rig.mute_buttons(is_mute=False)


def _second_master(rig: Rig) -> None:
    """A second master publishes another pose of the hand, at the rate of the first master."""
    rig.mark()
    place = hand.circle(0.0)
    place[1] += 0.05
    for _ in range(250):
        rig.publish(MASTER_MEASURED_CP, rig.now_ns(), place)
        rig.wait(hand.PERIOD)


def _second_master_in_gaps(rig: Rig) -> None:
    """The hand's samples have gaps, shorter than the command timeout, in which a second master goes on."""
    lost = round(_GAP / hand.PERIOD)
    rig.distort(hand.gapped(lost, lost))
    _second_master(rig)


def _leave_gaps(rig: Rig) -> None:
    rig.distort(hand.faithful)
    _leave(MASTER_MEASURED_CP)(rig)


def _drive_named(rig: Rig) -> None:
    """Drive one joint away from its nearer limit, by messages that name the joints in another order."""
    rig.distort(hand.silent)
    rig.wait(0.3)  # wait until other clients may drive the arm
    rig.mark()
    before, (ways, _) = rig.setpoint(), rig.way_to_limit()
    rig.drive(-_NAMED * np.sign(ways), 0.5, is_named=True)
    went = np.abs(rig.setpoint() - before)
    is_asked = ways != 0.0
    is_right = went[is_asked].min() > 0.2 * _NAMED and not went[~is_asked].any()
    rig.note("by name" if is_right else "not by name")


def _second_commander(rig: Rig) -> None:
    """A second publisher sends joint commands to another position."""
    rig.mark()
    begin = rig.setpoint()
    for count in range(250):
        rig.publish(SLAVE_SERVO_JP, rig.now_ns(), begin + 2e-4 * count)
        rig.wait(hand.PERIOD)


def _spoof(rig: Rig) -> None:
    """A second publisher sends a setpoint without a stamp on the slave's topic."""
    rig.mark()
    away = rig.setpoint() + 0.05
    for _ in range(250):
        rig.publish(SLAVE_SETPOINT_JS, 0, away)
        rig.wait(hand.PERIOD)


def _garble(topic: Topic, rig: Rig) -> None:
    """Send bytes that are not a valid message of the topic."""
    rng = np.random.default_rng(1)
    rig.mark()
    for length in (0, 1, 3, 4, 5, 8, 16, 64, 200, 1000):
        for _ in range(5):
            rig.publish_bytes(topic, bytes([0, 1, 0, 0]) + rng.bytes(length))
            rig.wait(2e-3)


def _garble_all(rig: Rig) -> None:
    for topic in (MASTER_MEASURED_CP, MASTER_BUTTONS, SLAVE_SERVO_JP, SLAVE_SETPOINT_JS, TELEOP_STATE):
        _garble(topic, rig)


def _leave(*topics: Topic) -> "partial[None]":
    return partial(_leave_all, topics)


def _leave_all(topics: tuple[Topic, ...], rig: Rig) -> None:
    for topic in topics:
        rig.leave(topic)
    rig.wait(0.1)


def _flood(rig: Rig) -> None:
    """Send as many samples as possible, all with a recent pose of the hand itself."""
    rig.mark()
    place = hand.circle(0.0)
    for _ in range(20_000):
        rig.publish(MASTER_MEASURED_CP, 1, place)


_WRONG = (Fault.PUBLISHERS, Fault.NONE)
SAMPLES = (
    Exercise(
        name="master_silent", text="hand silent for 3 s",
        inject=partial(_distort, hand.silent, seconds=3.0), undo=_straighten,
        states=(State.PAUSED,), faults=(Fault.SILENCE,), cures=(Cure.RESUME,), told=outage,
    ),
    Exercise(
        name="hiccup", text="hand silent for 0.5 s",
        inject=partial(_distort, hand.silent, seconds=0.5), undo=_straighten, watch=0.0,
    ),
    _disturbed("loss", "30 % of the hand's samples lost", hand.lossy(0.3)),
    _disturbed("loss_heavy", "90 % of the hand's samples lost", hand.lossy(0.9)),
    _disturbed("delay", "hand's samples 0.2 s late", hand.delayed(100), stands=after(0.2)),
    _disturbed("reordered", "hand's samples in reverse order, five at a time", hand.reordered(5)),
    _disturbed("replayed", "hand's samples of 0.2 s ago between the new ones", hand.replayed(100)),
    _disturbed("nan", "hand sends NaN", hand.filled(math.nan), motion=AllowedMotion.RESTS),
    _disturbed("infinite", "hand sends 1e308 m", hand.filled(1e308), motion=AllowedMotion.HOLDS,
               warns=True),
    _disturbed("teleport", "hand jumps by 10 cm", hand.shifted((0.1, 0.0, 0.0)), warns=True),
    _disturbed("turn", "hand turns by 1 rad at once", hand.turned(_TURN), warns=True),
    _disturbed("random", "hand at random places in 20 cm", hand.scattered(0.2),
               motion=AllowedMotion.HOLDS, warns=True),
    _disturbed("stamps_frozen", "hand's stamps stand still", hand.frozen_stamps(),
               motion=AllowedMotion.RESTS, warns=True),
    _disturbed("stamps_zero", "hand's stamps are 0", hand.stamped(lambda _: 0),
               motion=AllowedMotion.RESTS, warns=True),
    _disturbed("stamps_ahead", "hand's stamps 2 s ahead", hand.stamped(lambda ns: ns + _AHEAD_NS),
               motion=AllowedMotion.RESTS, warns=True),
    Exercise(
        name="buttons_silent", text="buttons silent for 1.5 s, hand goes on", inject=_mute,
        undo=_unmute, motion=AllowedMotion.HOLDS, allowed=lambda numbers: numbers.button_silence,
        warns=True,
    ),
    Exercise(
        name="fast_hand", text=f"hand shakes at {_SHAKEN:.1f} m/s, tool speed {_SLOW:g} m/s",
        inject=_shake, undo=_calm, motion=AllowedMotion.LED, hand_speed=_SHAKEN, tool_speed=_SLOW,
    ),
    Exercise(
        name="press_limit", text="servo_jv drives a joint into its limit", inject=_press_limit,
        undo=_straighten, motion=AllowedMotion.LED, faults=(Fault.JOINT_LIMIT,),
        told=lambda numbers: _PRESS + numbers.pressing_time,
    ),
    Exercise(
        name="second_master", text="second master for 0.5 s", inject=_second_master,
        undo=_leave(MASTER_MEASURED_CP), motion=AllowedMotion.GOES_ON,
        states=(State.ENABLED, State.PAUSED), cures=(Cure.NOTHING, Cure.RESUME),
    ),
    Exercise(
        name="second_master_in_gaps", text="second master for 0.5 s, hand with gaps of 0.08 s",
        inject=_second_master_in_gaps, undo=_leave_gaps, motion=AllowedMotion.GOES_ON,
        states=(State.ENABLED, State.PAUSED), cures=(Cure.NOTHING, Cure.RESUME), gap=after(_GAP),
    ),
    Exercise(
        name="named_joints", text="servo_jv names the joints in another order", inject=_drive_named,
        undo=_straighten, motion=AllowedMotion.LED, said="by name",
    ),
    Exercise(
        name="second_commander", text="second publisher of slave/servo_jp",
        inject=_second_commander, undo=_leave(SLAVE_SERVO_JP), motion=AllowedMotion.GOES_ON,
        states=(State.ENABLED, State.PAUSED), faults=_WRONG, cures=(Cure.NOTHING, Cure.RESUME),
    ),
    Exercise(
        name="spoofed_setpoint", text="forged slave/setpoint_js, 0.05 rad off, stamp 0",
        inject=_spoof, undo=_leave(SLAVE_SETPOINT_JS), motion=AllowedMotion.GOES_ON,
        states=(State.ENABLED, State.PAUSED), faults=_WRONG,
        cures=(Cure.NOTHING, Cure.RESUME),
    ),
    Exercise(
        name="garbage", text="random bytes on five topics", inject=_garble_all,
        undo=_leave(
            MASTER_MEASURED_CP, MASTER_BUTTONS, SLAVE_SERVO_JP, SLAVE_SETPOINT_JS, TELEOP_STATE
        ),
        motion=AllowedMotion.GOES_ON, states=(State.ENABLED, State.PAUSED), faults=_WRONG,
        cures=(Cure.NOTHING, Cure.RESUME),
    ),
    Exercise(
        name="flood", text="20,000 old samples at once", inject=_flood, stands=after(1.0),
        gap=lambda numbers: numbers.longest_pause, lost=1.0,
        undo=_leave(MASTER_MEASURED_CP), motion=AllowedMotion.GOES_ON,
        states=(State.ENABLED, State.PAUSED), cures=(Cure.NOTHING, Cure.RESUME),
    ),
)  # fmt: skip
"""Exercises with faults of messages in transport, and with messages of other publishers."""
