"""Broken copies: the package with one safety broken, or with a fault of the past put back.

Each copy is a few words of the source and what replaces them. :mod:`mutants` makes the copies, and drills and searches
them.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Schedule:
    """Faults in simulated time under which a mutant breaks a law; mostly what is left of a seed.

    Attributes:
        law: Which law.
        faults: Time, kind, process, length and amount of each, as of ``schedules.Fault``.
        seed: Of the machine.
    """

    law: str
    faults: tuple[tuple[float, str, str, float, float], ...]
    seed: int = 0


@dataclass(frozen=True)
class Mutant:
    """One broken safety.

    Attributes:
        name: By which it is asked for.
        text: What is broken.
        changes: Files in the package, each with text that stands in it once, and what replaces it.
        rows: Exercises of the drill that must find it, at least one of them.
        composed: Those in one process, if they are others.
        schedule: Schedule that must find it, beside exercises or in their place.
        past: Where the fault was reported: bugs of other stacks, or the release of this one in which it was mended;
            empty for a safety that was never broken.
    """

    name: str
    text: str
    changes: tuple[tuple[str, str, str], ...]
    rows: tuple[str, ...]
    composed: tuple[str, ...] | None = None
    schedule: Schedule | None = None
    past: str = ""

    def rows_of(self, *, is_composed: bool) -> tuple[str, ...]:
        """Exercises in one form; empty where that form does not have what is broken."""
        return self.rows if self.composed is None or not is_composed else self.composed


def _mutant(
    name: str,
    text: str,
    file: str,
    before: str,
    after: str,
    *rows: str,
    composed: tuple[str, ...] | None = None,
    schedule: Schedule | None = None,
    past: str = "",
) -> Mutant:
    return Mutant(name, text, ((file, before, after),), rows, composed, schedule, past)


_SLAVE, _COMMANDS, _WATCH = "nodes/slave.py", "slave/commands.py", "slave/operation/watch.py"
_RECORDER, _STAGE, _STEP = "nodes/recorder.py", "slave/slave.py", "slave/step.py"
_RELEASED = """            self.request(Event.STOP)
        elif self.state["state"] == State.FAULT:
            self.request(Event.RESET)
            self.request(Event.ENABLE)
"""
_SOME = """        came = [one for one in came if not (
            one[1].name.startswith("slave/measured") and one[0] // 1000 % 10 < 3)]
        came.sort(key=itemgetter(0))
"""
_CLOSED = """            try:
                self._writer.close()
            except RecordingError:
                self.exit_code = self.exit_code or 1  # the log"""
_LATE = """self._held = [*getattr(self, "_held", []),
                      *((now_ns, one) for one in self._stop.take(now_ns))]
            ready = [one for at, one in self._held if now_ns - at >= 20_000_000]
            self._held = [(at, one) for at, one in self._held if now_ns - at < 20_000_000]
            for is_pressed in ready:"""
MUTANTS = (
    _mutant("stop_ignored", "nobody hears the stop button", _SLAVE,
            "in self._stop.take(now_ns, is_idle=is_idle):", "in ():", "stop_topic",
            schedule=Schedule("stop", ((2.0, "press", "", 0.5, 0.5),)),
            past="0.7.0"),
    _mutant("stop_late", "the stop button is heard 20 ms late", _SLAVE,
            "for is_pressed in self._stop.take(now_ns, is_idle=is_idle):", _LATE, "stop_topic"),
    _mutant("silent_button", "a button that says nothing is released", "nodes/operation.py",
            "_GRACE_NS = 500_000_000", "_GRACE_NS = 500_000_000_000_000",
            schedule=Schedule("stop", ((2.0, "kill", "slave_side", 1.0, 0.5), (2.9, "press", "", 2.5, 0.5))),
            past="0.7.0"),
    _mutant("stop_unlatched", "a released stop button enables the arm", _STAGE,
            "            self.request(Event.STOP)\n", _RELEASED, "stop_latched",
            schedule=Schedule("asked", ((2.0, "press", "", 0.5, 0.5),)), past="0.7.0"),
    Mutant("press_lost", "the stop button's reader keeps one message",
           (("nodes/operation.py", "(Qos(keeps_all=True), Qos", "(Qos(depth=1), Qos"),
            ("slave/operation/presses.py", "missing = max(0, number - last - 1)", "missing = 0")),
           ("stop_brief",), past="0.7.0"),
    _mutant("released_by_others", "any button releases the stop", "slave/operation/presses.py",
            "self._holders.pop(sender, None)", "self._holders.clear()", "stop_two", past="0.7.0"),
    _mutant("reset_while_pressed", "a pressed stop can be reset", "slave/operation/states.py",
            "event == _RESET and s.is_pressed:", "event == _RESET and s.is_pressed > 1:",
            "stop_latched",
            schedule=Schedule("stop", ((2.0, "press", "", 2.0, 0.5), (2.6, "command", "", 0.1, 0.611))),
            past="0.7.0"),
    _mutant("stop_not_homing", "a stop is ignored while the arm homes", "slave/operation/states.py",
            "    if follower < 0:\n",
            "    if event == _STOP and s.is_homing:\n        return _REFUSED\n    if follower < 0:\n",
            "stop_homing", past="0.7.0"),
    _mutant("stop_not_disabled", "a stop of a disabled arm is not latched", "slave/operation/states.py",
            "    if follower < 0:\n",
            "    if event == _STOP and state == TABLE[0, _DISABLE]:\n        return _DONE\n    if follower < 0:\n",
            "stop_disabled",
            schedule=Schedule("stop", ((1.5, "command", "", 0.1, 0.056), (2.0, "press", "", 0.5, 0.5))),
            past="0.7.0"),
    _mutant("release_resets", "who overrides a stop button resets the stop", "nodes/operation.py",
            "            self._stop.release()\n",
            "            self._stop.release()\n            self._node.stage.press(is_pressed=False, heard_ns=0)\n"
            "            self._arm.request(\"reset\")\n",
            "stop_override",
            schedule=Schedule("asked", ((2.0, "press", "", 2.0, 0.5), (2.6, "command", "", 0.1, 0.5))),
            past="0.7.0"),
    _mutant("drives_on", "drives stay on after a fault of a drive", _WATCH,
            "            s.must_brake = 1\n", "            s.must_brake = 0\n", "stuck_effort", "overspeed"),
    _mutant("brakes_only_said", "drives that are said to be off stay on", "slave/simulation.py",
            "    braked = row.slave_operation[_BRAKED] > 0.0\n", "    braked = False\n", "overspeed"),
    _mutant("any_turn", "a hand may turn by any angle at once", "coupling/mapping/plausibility.py",
            "        and turn <= hand.turn * share\n", "", "turn"),
    _mutant("owner_hasty", "a stream is given away after 50 ms of silence", "nodes/sender.py",
            "round(silence * SECOND_NS)", "round(0.1 * silence * SECOND_NS)", "second_master_in_gaps", past="0.7.0"),
    _mutant("joints_in_order", "joints are taken in the order of the message", "bags/messages.py",
            "[names.index(name) for name in joint_names]", "list(range(len(joint_names)))", "named_joints"),
    _mutant("overspeed_off", "no joint is too fast", _WATCH,
            "fast = p.operation.overspeed * p.speed_limit[i]", "fast = 1e9 * p.speed_limit[i]",
            "overspeed"),
    _mutant("stop_soft", "a stop brakes as softly as a pause", _STEP,
            "commands.AT_ONCE if s.state == _FAULT or has_joined else commands.AT_LIMITS", "commands.AT_LIMITS",
            "stop_topic"),
    _mutant("reset_not_needed", "enable ends a stop without reset", "slave/operation/states.py",
            "{_D: _E, _E: _E, _P: _E}", "{_D: _E, _E: _E, _P: _E, _F: _E}", "stop_latched"),
    _mutant("heartbeat_ignored", "a silent stop button is none", _WATCH,
            "if p.heartbeat_ns > 0 and", "if p.heartbeat_ns > 10**18 and", "heartbeat"),
    _mutant("resume_moving", "resume is taken while the arm moves", "slave/operation/states.py",
            "and s.is_moving:", "and s.is_moving > 1:", "resume_early",
            schedule=Schedule("asked", ((2.0, "command", "", 0.1, 0.389), (2.015, "command", "", 0.1, 0.722))),
            past="0.7.0"),
    _mutant("no_pause", "silence never pauses", _COMMANDS,
            "0 < p.outage_ns < silence_ns", "0 < p.outage_ns < silence_ns - 10**18",
            "master_silent", schedule=Schedule("pause", ((2.0, "standstill", "hand_side", 4.0, 0.5),)), past="0.5.0"),
    _mutant("timeout_long", "commands are in force for 0.5 s longer", _STAGE,
            "round(parameters.command_timeout * 1e9)",
            "round(parameters.command_timeout * 1e9) + 500_000_000", "master_silent", past="turtlebot3 #1154"),
    _mutant("braking_weak", "the arm brakes with a tenth of what it can", _STAGE,
            'p.braking[:] = drives', 'p.braking[:] = 0.1 * drives', "master_silent", "disable",
            past="0.7.0"),
    Mutant("steps_large", "setpoints move 1.5 times as fast as their drives",
           ((_COMMANDS, "reach = p.speed_limit[i] * dt\n        step = min(max(s.filtered",
             "reach = 1.5 * p.speed_limit[i] * dt\n        step = min(max(s.filtered"),
            (_COMMANDS, "reach, before = p.speed_limit[i] * dt,", "reach, before = 1.5 * p.speed_limit[i] * dt,")),
           ("loss_heavy", "hiccup", "delay"),
           schedule=Schedule("speed", ((1.6, "standstill", "hand_side", 0.3, 0.5),), seed=1),
            past="0.7.0"),
    _mutant("tool_fast", "nothing limits the speed of the tool that joints move",
            _COMMANDS, "if step > most:", "if step > 1e9:", "fast_hand",
            schedule=Schedule("tool speed", ((1.0, "drive", "", 2.0, 0.5),)), past="xArm-Python-SDK #88"),
    _mutant("limits_off", "driven joints go beyond their limits", "slave/velocity.py",
            """        step = min(step, commands.stoppable(p.upper[i] - s.setpoint[i], most))
        step = max(step, -commands.stoppable(s.setpoint[i] - p.lower[i], most))
        commands.move_joint(p, s, i, step, dt)
""", """        s.setpoint[i], s.step[i] = s.setpoint[i] + step, step
""", "press_limit"),
    _mutant("tracking_off", "no joint is too far from its setpoint", _WATCH,
            "if not off <= p.lag[i]:", "if not off <= 1e9:", "stuck_tracking"),
    _mutant("tip_off", "no tip is too far from its setpoint", _WATCH,
            "if not square <= p.tip_error * p.tip_error:", "if not square <= 1e9:", "stuck_tip"),
    _mutant("effort_off", "no drive is at its limit for too long", _WATCH,
            "> p.effort_ns:", "> 10**18:", "stuck_effort"),
    _mutant("stall_unnoticed", "a loop that stood still goes on", _SLAVE,
            "if 0.0 < longest < missed:", "if 0.0 < longest < missed - 1e9:", "freeze_slave",
            composed=("freeze_session",),
            schedule=Schedule("pause", ((2.0, "standstill", "slave_side", 3.0, 0.5),)),
            past="0.6.0"),
    _mutant("samples_first", "all samples of a standstill are answered before the stop", _SLAVE,
            "in waiting[-_ANSWERS:-1]:", "in waiting[:-1]:", "freeze_slave", composed=(), past="0.7.0"),
    _mutant("silent_arm", "an arm that says nothing is at rest", _WATCH,
            "if silence_ns > p.silence_ns:", "if silence_ns > 10**18:", "freeze_slave_sim",
            composed=()),
    _mutant("clock_unnoticed", "a stepped clock is none", _SLAVE,
            "> _CLOCK_STEP_NS:", "> 10**30:", "clock_ahead", "clock_back"),
    _mutant("second_publishers", "messages of all publishers are taken",
            "nodes/wire.py", "if r.has_owner and now_ns - r.heard_ns <= r.silence_ns:", "if False:",
            "second_master", "second_commander", composed=("second_master",),
            schedule=Schedule("owner", ((2.0, "intruder", "", 1.0, 0.5),)), past="ros2_control #870"),
    Mutant("old_messages", "messages older than the last one are taken",
           (("nodes/wire.py", "return _NOT_NEWER if has_last and stamp_ns <= last_ns else 0", "return 0"),
            (_COMMANDS, "is_new, last_ns = stamp_ns > s.seen_ns,", "is_new, last_ns = stamp_ns != s.seen_ns,")),
           ("replayed", "stamps_frozen"), past="axol #187"),
    _mutant("plausibility_off", "a hand may be anywhere at once", "coupling/mapping/plausibility.py",
            "    if not is_sound:\n", "    is_sound = True\n    if not is_sound:\n",
            "teleport", "infinite"),
    _mutant("buttons_forgotten", "silent buttons are released ones",
            "coupling/mapping/plausibility.py",
            "return bool(s.is_lost)", "return False", "buttons_silent"),
    _mutant("measured_lies", "the arm measures what it was told", "slave/simulation.py",
            "row.slave_measured_js[i] = s.measured[i]",
            "row.slave_measured_js[i] = arm.setpoint[i]", "stuck_tracking"),
    _mutant("recorder_late", "the recorder holds messages for 2 s", _RECORDER,
            "HOLD_NS = 100_000_000", "HOLD_NS = 2_000_000_000", "kill_recorder",
            composed=("kill_session",),
            schedule=Schedule("recorded", ((2.5, "kill", "recorder", 1.0, 0.5),)),
            past="0.5.0"),
    _mutant("not_recorded", "30 % of slave/measured* are not recorded", _RECORDER,
            "        came.sort(key=itemgetter(0))\n", _SOME, "hiccup"),
    # known of public stacks
    Mutant("commands_queued", "commands that waited during an outage run after it",
           (("nodes/streams.py", "_WAITING = 20", "_WAITING = 20_000"),
            ("nodes/wire.py", "if r.is_buttons and not (target", "if not r.is_buttons or not (target")),
           (), schedule=Schedule("age", ((2.0, "standstill", "slave_side", 3.0, 0.5),)), past="stretch_web_teleop #3"),
    Mutant("queue_kept", "a queue grows for as long as its reader stands still",
           (("nodes/streams.py", "_WAITING = 20", "_WAITING = 20_000"),
            ("nodes/wire.py", "if r.is_buttons and not (target", "if not r.is_buttons or not (target")),
           (), schedule=Schedule("queues", ((2.0, "standstill", "slave_side", 4.5, 0.5),))),
    _mutant("engage_jumps", "who engages leads on from where the hand was", "coupling/mapping/motion_scaling.py",
            "        s.must_latch = 1\n        if not is_doubtful:\n"
            "            copy(row.slave_setpoint_cp, s.command)\n",
            "        s.must_latch = 1 - s.is_engaged\n",
            "master_silent", "stop_topic", schedule=Schedule("engage", (
                (2.0, "command", "", 0.1, 0.389), (3.1, "command", "", 0.1, 0.722))),
            past="moveit2 #3378, IsaacTeleop #730"),
    Mutant("late_teleoperator", "who publishes later is never heard",
           (("nodes/wire.py", "now_ns - r.heard_ns <= r.silence_ns", "now_ns - r.heard_ns <= 10**18"),
            ("nodes/sender.py", 'no longer exists."""\n        self._cells["has_owner"] = 0',
             'no longer exists."""')),
           ("kill_motion_scaling",), composed=(),
           schedule=Schedule("recovery", ((2.0, "kill", "hand_side", 1.0, 0.5),)), past="lerobot #4166"),
    _mutant("never_gives_way", "a loop that cannot keep up keeps its real-time priority", "nodes/strain.py",
            "            self._platform.give_way()\n", "",
            schedule=Schedule("way", ((2.0, "slow turns", "slave_side", 6.0, 0.9),)), past="0.7.0"),
    _mutant("drive_goes_on", "a joint goes on at its last speed when the link is lost", "slave/velocity.py",
            "is_stale = now_ns - s.driven_ns > p.timeout_ns",
            "is_stale = now_ns - s.driven_ns > p.timeout_ns + 10**18", "press_limit", past="turtlebot3 #1154"),
    _mutant("stopped_says_ready", "a stopped arm says that it is ready", _WATCH,
            "row[0], row[1], row[2], row[3] = s.state,",
            "row[0], row[1], row[2], row[3] = max(1, s.state % 3),", "stop_topic", past="several stacks"),
    _mutant("clock_kept", "a slave keeps the clock of its start, however wrong that was", _SLAVE,
            "self.epoch_ns = offset_ns", "pass", schedule=Schedule("recovery", (
                (1.3, "kill", "slave_side", 1.0, 0.5), (2.57, "clock step", "", 0.5, 0.91))), past="0.7.0"),
    _mutant("late_reports", "a restarted slave reports late what it is", _SLAVE,
            "        before = self._reported\n        super().send_report",
            "        if self._turns < 2000:\n            return\n        before = self._reported\n"
            "        super().send_report",
            schedule=Schedule("told", ((2.0, "kill", "slave_side", 1.0, 0.5),)), past="several stacks"),
    _mutant("stop_leaves_moves", "a stop leaves a move active", "slave/operation/states.py",
            "    if follower != _ENABLED:\n        s.is_busy",
            "    if follower not in (_ENABLED, _FAULT):\n        s.is_busy",
            schedule=Schedule("motion", (
                (1.0, "command", "", 0.1, 0.28), (1.15, "press", "", 0.5, 0.5))),
            past="dimos #3004, Universal_Robots_ROS_Driver #68"),
    _mutant("garbage_ends", "bytes that are no message end the node that reads them",
            "nodes/streams.py", "        if isinstance(found, messages.Refusal):\n"
            "            self._refuse(found)\n            return False\n", "",
            schedule=Schedule("ends", (
                (1.0, "kill", "hand_side", 1.5, 0.5), (2.0, "garbage", "", 0.5, 0.5))), past="0.5.0"),
    _mutant("saved_all", "a recorder whose disk is gone says that all is safe",
            "bags/ending.py", "s ({found.message_count} of", "s ({given} of",
            schedule=Schedule("recorded", ((2.0, "gone disk", "", 1.0, 0.5),)), past="0.5.0"),
    Mutant("losses_untold", "what waits for a recorder that stands still is lost, and not counted",
           (("nodes/feed.py", "if fill and len(self.waiting) < MOST", "if fill and len(self.waiting) < 50_000"),
            ("nodes/feed.py", "lost = number - last.get(index, number - 1) - 1", "lost = 0")),
           (), schedule=Schedule("recorded", ((2.0, "standstill", "recorder", 2.5, 0.5),)), past="rosbag2 #477"),
    _mutant("not_closed", "the recording is left open at the end", _RECORDER,
            _CLOSED, _CLOSED.replace("self._writer.close()", "pass"), "hiccup", past="0.5.0"),
    _mutant("stamp_zero", "a setpoint that follows no command has the stamp 0, which clients refuse", _STEP,
            "s.command_stamp_ns, s.motion = topics.NO_COMMAND_NS, 0", "s.command_stamp_ns, s.motion = 0, 0",
            schedule=Schedule("owner", ((2.0, "command", "", 0.1, 0.278),)),
            past="0.5.0"),
    Mutant("poisoned", "a speed that no arm has makes setpoints that are no numbers, for good",
           (("slave/motion_commands.py", "if (np.abs(wanted) > most).any():", "if False:"),
            (_STEP, "        if not math.isfinite(s.setpoint[i]):", "        if False:")),
           (),
            schedule=Schedule("speed", ((1.9, "drive", "", 1.0, 0.5000025),)),
            past="0.7.0"),
    Mutant("future_kept", "one stamp of the future shuts out all later commands",
           ((_COMMANDS, "    if stamp_ns < s.seen_ns - ownership.AHEAD_NS:", "    if False:"),
            (_COMMANDS, "    if stamp_ns <= row.now_ns + max(0, -s.ahead_ns) + ownership.AHEAD_NS:", "    if True:")),
           (),
            schedule=Schedule("recovery", (
                (1.5, "kill", "hand_side", 3.0, 0.5), (2.7, "intruder", "", 0.6, 0.5000025))),
            past="0.7.0"),
    _mutant("old_shut_out", "a sender whose clock was set back is refused for good", "nodes/wire.py",
            "if now_ns - r.arrival_ns > SILENCE_NS or (r.may_repeat", "if (r.may_repeat",
            schedule=Schedule("recovery", ((1.5, "clock step", "", 5.5, 0.5820015),
                (2.0, "kill", "hand_side", 1.0, 0.5), (7.2, "kill", "hand_side", 1.0, 0.5))),
            past="0.7.0"),
    _mutant("chunks_given_up", "a recording whose index cannot be written gives up its messages", "bags/mcap_file.py",
            "            with suppress(OSError):\n                self._cut()\n            raise",
            "            self._end = len(self._head)\n            with suppress(OSError):\n"
            "                self._cut()\n            raise",
            schedule=Schedule("recorded", ((2.0, "full disk", "", 1.0, 0.5),)),
            past="0.5.0"),
    _mutant("homing_forgotten", "an arm that paused while it moved home stays where it is after resume",
            "slave/operation/states.py", "s.must_home = s.is_homing if follower == _PAUSED else 0", "s.must_home = 0",
            schedule=Schedule("asked", (
                (2.0, "command", "", 0.1, 0.278), (2.15, "command", "", 0.1, 0.389), (2.7, "command", "", 0.1, 0.722))),
            past="0.7.0"),
)  # fmt: skip
"""All of them."""
SOUND = Mutant("sound", "nothing is broken", (), ())
"""A copy with which no row may fail."""
