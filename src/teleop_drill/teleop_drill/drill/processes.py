"""Exercises with processes that are killed, stopped for a time, hang, get no processor time, or have a full disk."""

from collections.abc import Callable
from functools import partial

from teleop_core.graph.operation import State
from teleop_core.slave.operation import Fault
from teleop_drill.drill.exercise import (
    AllowedMotion,
    Cure,
    Exercise,
    Master,
    Rig,
    after,
    at_once,
    outage,
    silence,
    unheard,
)
from teleop_drill.drill.hand import SPEED
from teleop_drill.drill.inside import HANGS, RAISES, SLOWS, WORKS
from teleop_drill.drill.numbers import Numbers
from teleop_drill.drill.recordings import LONGEST_LOSS

FREEZE = 3.0
"""Time for which a process is stopped [s]."""
_STAGES = ("haptic_master", "motion_scaling", "inverse_kinematics")
_LOOK = 0.01
"""Time between two checks of the slave's clocks, or between two checks of a file by the drill [s]."""
_PATIENCE_NS = 2_000_000_000
"""Longest time for which a recorder is observed to find out how long it buffers messages [ns]."""
_HOUR_NS = 3_600_000_000_000


def _kill(node: str, rig: Rig) -> None:
    rig.mark()
    rig.kill(node)


def _kill_writer(node: str, rig: Rig) -> None:
    """Kill the recorder as soon as the data that waits for the disk exceeds the allowed loss, or after a time limit."""
    written, since_ns = rig.written(), rig.now_ns()
    end_ns = since_ns + _PATIENCE_NS
    while (now_ns := rig.now_ns()) < end_ns and now_ns - since_ns <= 1e9 * LONGEST_LOSS:
        if rig.written() != written:
            written, since_ns = rig.written(), now_ns
        rig.wait(_LOOK)
    _kill(node, rig)


def _freeze(node: str, rig: Rig) -> None:
    rig.mark()
    rig.freeze(node, FREEZE)


def _hog(rig: Rig) -> None:
    rig.mark()
    rig.hog(3.0)


def _bystander(rig: Rig) -> None:
    rig.start_bystander()
    rig.wait(0.5)
    rig.mark()
    rig.kill_bystander()
    rig.wait(2.5)


def _fill_disk(rig: Rig) -> None:
    rig.limit_files("recorder", 65_536)
    rig.mark()
    rig.wait(2.0)


def _break(word: int, rig: Rig) -> None:
    rig.mark()
    rig.control(word)


def _mend(rig: Rig) -> None:
    rig.control(WORKS)


def _step_clock(offset_ns: int, rig: Rig) -> None:
    rig.mark()
    rig.control(WORKS, offset_ns)


def _killed(node: str) -> Exercise:
    """Exercise that kills a stage between hand and slave; the stage's last command times out, then the arm brakes."""
    return Exercise(
        name=f"kill_{node}", text=f"{node} killed", inject=partial(_kill, node),
        states=(State.PAUSED,), faults=(Fault.SILENCE,), cures=(Cure.RESTART,),
        master=Master.DEVICE, told=outage, watch=2.6, ways=(False,),
    )  # fmt: skip


def _frozen(node: str) -> Exercise:
    return Exercise(
        name=f"freeze_{node}",
        text=f"{node} stopped for {FREEZE:g} s",
        inject=partial(_freeze, node),
        states=(State.PAUSED,),
        faults=(Fault.SILENCE,),
        cures=(Cure.RESUME,),
        master=Master.DEVICE,
        told=outage,
        ways=(False,),
    )


def _let_go(numbers: Numbers) -> float:
    return numbers.hand_timeout


def _broken(name: str, text: str, inject: Callable[[Rig], None]) -> tuple[Exercise, Exercise]:
    """Two exercises with a stage that fails: in its own process, and in the process of all stages."""
    alone = Exercise(
        name=name, text=text, inject=inject, undo=_mend, states=(State.PAUSED,),
        faults=(Fault.SILENCE,), cures=(Cure.RESTART,), told=outage, watch=2.6, ways=(False,),
    )  # fmt: skip
    together = Exercise(
        name=name,
        text=f"{text}: ends the session",
        inject=inject,
        undo=_mend,
        states=(None,),
        cures=(Cure.RESTART,),
        watch=4.0,
        ways=(True,),
    )
    return alone, together


PROCESSES = (
    Exercise(  # the hand releases the stylus, and the arm holds its position as with the clutch pressed
        name="kill_operator", text="operator killed", inject=partial(_kill, "operator"),
        motion=AllowedMotion.HOLDS, allowed=_let_go, master=Master.DEVICE, watch=2.6, warns=True,
        ways=(False,),
    ),
    *(_killed(node) for node in _STAGES),
    Exercise(
        name="kill_slave", text="slave killed", inject=partial(_kill, "slave"),
        states=(None,), cures=(Cure.RESTART,), master=Master.DEVICE, ways=(False,),
    ),
    Exercise(
        name="kill_slave_sim", text="slave_sim killed", inject=partial(_kill, "slave_sim"),
        states=(State.FAULT,), faults=(Fault.FEEDBACK,), cures=(Cure.RESTART,), told=silence,
        allowed=unheard,
        master=Master.DEVICE, watch=2.6, ways=(False,),
    ),
    Exercise(
        name="kill_recorder", text="recorder killed", inject=partial(_kill_writer, "recorder"),
        motion=AllowedMotion.GOES_ON, master=Master.DEVICE, watch=1.0, ways=(False,), cuts_recording=True,
    ),
    Exercise(
        name="kill_session", text="whole session killed", inject=partial(_kill_writer, "slave"),
        states=(None,), cures=(Cure.RESTART,), master=Master.DEVICE, ways=(True,),
        cuts_recording=True,
    ),
    *(_frozen(node) for node in _STAGES),
    Exercise(
        name="freeze_slave", text=f"slave stopped for {FREEZE:g} s",
        inject=partial(_freeze, "slave"), states=(State.PAUSED,),
        faults=(Fault.STALL,), told=at_once,
        cures=(Cure.RESUME,), master=Master.DEVICE, ways=(False,),
    ),
    Exercise(
        name="freeze_slave_sim", text=f"slave_sim stopped for {FREEZE:g} s",
        inject=partial(_freeze, "slave_sim"), states=(State.FAULT,),
        faults=(Fault.FEEDBACK,), told=silence, allowed=unheard, gap=unheard,
        by_drives=True,
        cures=(Cure.RESET,), master=Master.DEVICE, ways=(False,),
    ),
    Exercise(
        name="freeze_recorder", text=f"recorder stopped for {FREEZE:g} s",
        inject=partial(_freeze, "recorder"), motion=AllowedMotion.GOES_ON, master=Master.DEVICE,
        lost=FREEZE, ways=(False,),
    ),
    Exercise(
        name="freeze_session", text=f"whole session stopped for {FREEZE:g} s",
        inject=partial(_freeze, "slave"), states=(State.PAUSED,),
        faults=(Fault.STALL,), told=at_once,
        cures=(Cure.RESUME,), master=Master.DEVICE, ways=(True,),
    ),
    Exercise(
        name="kill_bystander", text="foreign subscriber of all streams killed", inject=_bystander,
        motion=AllowedMotion.GOES_ON, master=Master.DEVICE,
    ),
    Exercise(
        name="hog", text="all cores kept busy for 3 s", inject=_hog, motion=AllowedMotion.GOES_ON,
        states=(State.ENABLED, State.PAUSED), cures=(Cure.NOTHING, Cure.RESUME),
        master=Master.DEVICE,
    ),
    *_broken("stage_hangs", "a stage hangs in a step", partial(_break, HANGS)),
    Exercise(  # ticks are skipped, so the arm follows the hand in larger steps
        name="stage_slow", text="a stage takes 3 ms for a step", inject=partial(_break, SLOWS), undo=_mend,
        motion=AllowedMotion.GOES_ON, watch=6.0, warns=True, allowed=after(4.0), stands=after(3.0),
        hand_speed=2.0 * SPEED, ways=(True,),
    ),
    *_broken("stage_raises", "a stage raises in a step", partial(_break, RAISES)),
    Exercise(
        name="clock_ahead", text="clock stepped 1 h ahead", inject=partial(_step_clock, _HOUR_NS),
        undo=_mend, states=(State.PAUSED,), faults=(Fault.CLOCK,), cures=(Cure.RESUME,),
        allowed=after(_LOOK), told=after(_LOOK),
    ),
    Exercise(
        name="clock_back", text="clock stepped 1 h back", inject=partial(_step_clock, -_HOUR_NS),
        undo=_mend, states=(State.PAUSED,), faults=(Fault.CLOCK,), cures=(Cure.RESUME,),
        allowed=after(_LOOK), told=after(_LOOK),
    ),
    Exercise(
        name="disk_full", text="disk full under the recording", inject=_fill_disk,
        motion=AllowedMotion.GOES_ON, ways=(False,), cuts_recording=True,
    ),
    Exercise(
        name="disk_full", text="disk full under the recording: ends the session",
        inject=_fill_disk, states=(None,), cures=(Cure.RESTART,), allowed=after(3.0), watch=2.0,
        ways=(True,), cuts_recording=True,
    ),
)  # fmt: skip
"""Exercises with faults of processes and of their machine."""
