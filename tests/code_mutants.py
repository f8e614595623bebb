"""Code mutants: copies of the package with one line broken, each of which a quick test must find.

    python tests/code_mutants.py --list
    python tests/code_mutants.py sticking touch_drop

Safeties that only a running session has are broken in :mod:`mutants`, and found by the drill. Here
are the rest: what a tick computes, what a score says, what the console lets through. A mutant is
found when a test of its files fails; each file passes with the package as it is.
"""

import argparse
import os
import signal
import subprocess
import sys
import time

from mutants import ROOT, Mutant, tree

UNIT = "tests/unit/test_"


def _mutant(name: str, text: str, file: str, before: str, after: str, *tests: str) -> Mutant:
    files = tuple(one if "/" in one else f"{UNIT}{one}.py" for one in tests)
    return Mutant(name, text, ((file, before, after),), files)


_BUTTON = "slave/world/button.py"
_CONTACT, _PUNCTURE = "slave/world/contact.py", "slave/world/puncture.py"
_SCALING, _LINK = "chain/mapping/motion_scaling.py", "chain/network/link.py"
_SIDE = "chain/mapping/side.py"
_TDPA, _CENTRE = "chain/passivity/tdpa.py", "chain/fixtures/remote_centre.py"
_HELD = "chain/passivity/held_back.py"
_CENTRE_SCORE, _TOUCH = "evaluation/metrics/remote_centre.py", "evaluation/metrics/touch.py"
_JAW, _JAW_SCORE = "slave/jaw/jaw.py", "evaluation/metrics/jaw.py"
_GRIP, _TRANSFER = "slave/jaw/grip.py", "evaluation/metrics/transfer.py"
_GRIPPER = "slave/bridges/jaw_bridge.py"
_YIELD = "chain/architectures/impedance.py"
_PID, _WAY = "slave/controllers/pid.py", "slave/interpolation.py"
_HAND, _OBSERVER = "chain/master/hand_mechanics.py", "slave/force_observer.py"
CODE_MUTANTS = (
    _mutant("reports_meet", "all nodes report at once", "nodes/rate.py",
            "place = stages.index(stage) if stage in stages else len(stages)", "place = 0", "rate"),
    _mutant("js_unanswered", "of two samples of the arm in a tick one is answered",
            "nodes/slave.py", "in waiting[-_ANSWERS:-1]:", "in waiting[:0]:",
            "tests/simulated/test_bursts.py"),
    _mutant("short_queue", "a queue forgets what a late sender makes up for", "nodes/streams.py",
            "options.max_catch_up if", "20 if", "tests/simulated/test_bursts.py"),
    _mutant("parsers_loaded", "each node loads parsers of message definitions",
            "middleware/ros_type_support.py", "    if _GENERATOR in sys.modules:", "    if True:",
            "tests/ros/test_light_nodes.py"),
    _mutant("warm_reset", "a step for practice counts", "graph/warming.py",
            "    runner.reset()\n", "", "warming"),
    _mutant("warm_signals", "a step for practice leaves its outputs", "graph/warming.py",
            "    assign(runner.signals, before)\n", "", "warming"),
    _mutant("last_scaled", "speeds of joints are scaled for the last one that is too fast (as in "
            "moveit2 #2540)", "slave/velocity.py", "share = min(share, most / fast)",
            "share = most / fast", "motion_commands"),
    _mutant("thaw_leads", "a bridge that stood still leads on from where the arm was",
            "slave/bridges/arm_bridge.py", "if is_late and self.lead_arm.has_lost(",
            "if False and self.lead_arm.has_lost(", "arm_bridge"),
    _mutant("gap_followed", "a jump of the hand in a gap of its samples is followed",
            "chain/mapping/plausibility.py", "max(_GAP, 2e-9 * s.raw_elapsed_ns) / period",
            "1.0", "plausible_hand"),
    _mutant("buttons_paused", "a pause of the poses makes single presses of a stream of buttons",
            "chain/mapping/plausibility.py", "max(s.in_row - _STREAM, 0)", "0", "plausible_hand"),
    # kernels and robots
    _mutant("margin_first", "a margin from a limit is worth any way", "robots/swivel.py",
            "> most + BESIDE_SEED:", "> most + 10.0:", "closed_forms"),
    _mutant("noise_stops", "noise of the hand keeps seven axes from leaving a singular posture",
            "robots/swivel.py", "* left * left", "* max(4.0 * left - 3.0, 0.0)", "real_arms"),
    _mutant("search_short", "a search for the least move that a limit slows is given up",
            "robots/swivel.py", "ZERO < square < _CLOSE and", "False and", "closed_forms"),
    _mutant("far_turn", "a turn beyond half a turn goes the long way", "kernels/geometry.py",
            "sign = -1.0 if turn[0] < 0.0 else 1.0", "sign = 1.0", "geometry"),
    _mutant("force_here", "a force's torque about the base is that about the tip",
            "kernels/geometry.py", "torque + np.cross(pose[:3], force)", "torque", "geometry"),
    _mutant("force_turned", "a force along the tip's axes is turned the other way",
            "kernels/geometry.py", "((turn.T * force)", "((turn * force)", "geometry"),
    _mutant("version_beside", "what another version keeps meanwhile ends a program",
            "kernels/numba_private.py", "except _BROKEN:  # by another", "except EOFError:  # by",
            "kernel_cache"),
    _mutant("kernels_kept", "kernels are thrown away while they are used", "kernels/store.py",
            "if index.stat().st_mtime < oldest:", "if index.stat().st_mtime > oldest:",
            "kernel_cache"),
    _mutant("recordings_spliced", "several recordings of one table become one hand",
            "session/exchange/imported_motion.py", "if len(rows := restarts(stamps)):",
            "if len(rows := restarts(stamps)) > 99:", "import_tables"),
    _mutant("frames_mixed", "poses in two frames become one hand",
            "session/exchange/bag_messages.py", "if self.taken not in {None, named}:",
            "if not named:", "import_bags"),
    _mutant("soft_limits", "an arm goes beyond the soft limits of its file", "robots/urdf_tree.py",
            "max(lower, soft[0]), min(upper, soft[1])", "lower, upper", "robots_from_urdf"),
    _mutant("words_left_out", "a word that is no number is left out of a file's numbers",
            "robots/urdf_tree.py", "for word in text.split()])",
            "for word in text.split() if math.isfinite(_number(word))])", "robots_from_urdf"),
    _mutant("inertia_off", "a body's inertia lacks its distance from the axis",
            "robots/chain_dynamics.py", "turned + (square + along if i == j else 0.0)",
            "turned + (square if i == j else 0.0)", "robots_from_urdf"),
    _mutant("far_arc", "of the swivel's legal arcs one that is farther off is taken",
            "robots/swivel_arcs.py", "up if above <= below else down", "down", "closed_forms"),
    _mutant("arc_missed", "arcs of the swivel beyond half a radian are not looked for",
            "robots/swivel_arcs.py", ">= abs(psi):", ">= min(abs(psi), 0.5):", "closed_forms"),
    _mutant("flat_stays", "the swivel of seven axes does not care for manipulability",
            "robots/swivel.py", "if urge > 0.0:", "if urge > 2.0:", "closed_forms"),
    _mutant("narrower", "the swivel of seven axes goes where manipulability shrinks",
            "robots/swivel.py", "change + side * width", "change - side * width", "closed_forms"),
    _mutant("factor_lost", "a follower's inertia counts once by its factor",
            "robots/followers.py", "row[1 + m + i] * row[1 + m + k]", "row[1 + m + i]",
            "followers"),
    # chain
    _mutant("edge_missed", "a held mode button toggles at every sample", _SCALING,
            "if buttons[2] > s.buttons[2]:", "if buttons[2] > 0.0:", "motion_scaling"),
    _mutant("fixture_slips", "a fixture stays behind when the hand is aligned anew", _SCALING,
            "s.center[i] += stylus[i] - s.stylus[i]", "s.center[i] += 0.0", "motion_scaling",
            "fixtures"),
    _mutant("union_far", "of a union the farthest part holds the hand", "chain/fixtures/union.py",
            "shape, -1.0, depth)", "shape, 1.0, depth)", "fixtures_combined"),
    _mutant("turns_off", "an intersection is left where its parts were gone to in turn",
            "chain/fixtures/intersection.py", "kept[part, i] = way[i]", "kept[part, i] = 0.0",
            "fixtures_combined"),
    _mutant("part_moved", "parts of a shape stand at its middle", "chain/fixtures/combined.py",
            "offset[i] = place[i] - shape[first + 2 + i]", "offset[i] = place[i]",
            "fixtures_combined"),
    _mutant("mesh_open", "a mesh holds no hand in", "chain/fixtures/mesh.py",
            "max(mesh_distance(from_middle, shape[3:], depth), 0.0)",
            "max(-mesh_distance(from_middle, shape[3:], depth), 0.0)", "fixture_meshes"),
    _mutant("mesh_begun", "a hand may begin outside of the mesh that holds it",
            "chain/fixtures/mesh.py", "if side * outside > 0.0:", "if False:", "fixture_meshes"),
    _mutant("mesh_gone", "a fixture's mesh is scored by the file of today",
            "chain/fixtures/reported_fixture.py", "moved.get(text, text)", "text",
            "fixture_meshes"),
    _mutant("side_leaves", "a place beyond a fixture is drawn in half-way", _SIDE,
            "place[i] -= fixture.out[i]", "place[i] -= 0.5 * fixture.out[i]", "fixture_side"),
    _mutant("side_thrown", "the slave runs after a hand that came through a forbidden body", _SIDE,
            "if is_free and _distance(aim, last) > most + _ROUNDING:", "if False:",
            "fixture_side"),
    _mutant("side_jumps", "the slave jumps to the nearest place, however far it is", _SIDE,
            "if not _draw_in(fixture, aim) or _distance(aim, last) > most + _ROUNDING:",
            "if not _draw_in(fixture, aim):", "fixture_side"),
    _mutant("side_forgets", "a hand that comes back moves the slave before it is inside", _SIDE,
            "s.beyond[i] = hand[i] - aim[i]", "s.beyond[i] = 0.0", "fixture_side"),
    _mutant("side_all", "the hand feels a fixture of the slave alone", _SCALING,
            "if s.is_fixture_on and p.holds_hand:", "if s.is_fixture_on:", "fixture_side"),
    _mutant("side_slips", "the fixture is reported beyond where it holds the slave", _SCALING,
            "s.center[i] - s.master[i] + s.beyond[i]", "s.center[i] - s.master[i]",
            "fixture_side"),
    _mutant("unit_lost", "commanded turns drift off unit length", _SCALING,
            "s.command[i] *= 1.5 - 0.5 * square", "s.command[i] *= 1.0", "motion_scaling"),
    _mutant("wild_hand", "the sample after a wild one is compared with it",
            "chain/mapping/plausibility.py", "s.is_doubted = 0 if is_sound else 1",
            "s.is_doubted = 0", "plausible_hand"),
    _mutant("sticking", "the device's friction never holds it", _HAND,
            "sticks = square <= p.friction * p.friction", "sticks = False", "haptic_master"),
    _mutant("felt_early", "the device is farther within a tick than its held force brings it",
            _HAND, "given[i, _PUSH] -= share * needed[i]\n",
            "given[i, _PUSH] -= share * needed[i]\n"
            "        s.position[i] += 0.25 * (time + 1e-3) * (1.0 - share) * given[i, _PUSH] * "
            "p.flow[0, i, _SPEED, _PUSH]\n", "stability"),
    _mutant("stops_bend", "a hand that leans on the device's stop bends its wrist", _HAND,
            "s.hand[i], s.hand_speed[i] = s.position[i], 0.0", "pass", "haptic_master"),
    _mutant("wobble", "the gimbal's noise exceeds its bound", "chain/master/device.py",
            "min(max(0.5 * noise[i], -1.0), 1.0)", "0.5 * noise[i]", "haptic_master"),
    _mutant("centre_short", "the tool turns 1 % too little towards its centre", _CENTRE,
            "room.turn[i] *= angle", "room.turn[i] *= 0.99 * angle", "remote_centre"),
    _mutant("centre_near", "the tip may come nearer to its centre than allowed", _CENTRE,
            "max(p.least - along, 0.0)", "max(0.5 * p.least - along, 0.0)", "remote_centre"),
    _mutant("centre_jerk", "the tool turns at once as far as it must", _CENTRE,
            "if angle > most:", "if angle > 1e9:", "remote_centre"),
    _mutant("silent_device", "a device that says nothing is pushed on",
            "chain/master/master_bridge.py", "age <= p.force_timeout and self.is_heard(now_ns)",
            "age <= p.force_timeout", "master_bridge"),
    _mutant("from_tomorrow", "poses that are stamped ahead are believed",
            "slave/bridges/hearing.py", "0.0 < oldest < abs(age)", "0.0 < oldest < age",
            "master_bridge"),
    _mutant("intention_late", "the score against intention leaves out what the filter changed",
            "evaluation/metrics/tremor_filter.py", "(tremor, after[own] - before[own] + tremor)",
            "(tremor, tremor)", "tremor_filters"),
    # network and passivity
    _mutant("order_lost", "packets that shall keep their order overtake", _LINK,
            "due = max(due, s.last_due[k])", "due = max(due, 0)", "network"),
    _mutant("old_arrives", "a packet that was overtaken is taken for the newest", _LINK,
            "if not is_due or way.number[at] <= s.newest[k]:", "if not is_due:", "network"),
    _mutant("line_shared", "packets do not wait for the line", _LINK,
            "s.free[k] += way.waiting", "s.free[k] = s.tick + way.waiting", "bandwidth"),
    _mutant("line_lazy", "a line that was idle makes up for it", _LINK,
            "s.free[k] = max(s.free[k], float(s.tick))", "pass", "bandwidth"),
    _mutant("queue_endless", "a full queue of kept packets takes more", _LINK,
            "if p.keeps_order[k] and s.waits[k] >= p.queue[k]:", "if False:", "bandwidth"),
    _mutant("header_free", "headers have no size", "chain/network/packet_size.py",
            "HEADER = 20 + 8", "HEADER = 0", "bandwidth"),
    _mutant("clock_asked", "the age of a force is told from the slave's clock",
            "chain/mapping/following.py", "s.felt_at_ns = now_ns",
            "s.felt_at_ns = row.slave_measured_cf_ns", "two_clocks"),
    _mutant("clock_scored", "ages that are scored hold the offset of the slave's clock",
            "evaluation/metrics/network.py", "stamps = stamps - _clock_ahead_ns(window, logs)",
            "pass", "two_clocks"),
    _mutant("burst_short", "a burst of losses ends as if none had begun",
            "chain/network/gilbert_elliott.py",
            "border = numbers[1] if memory[1] > 0.0 else numbers[0]", "border = numbers[0]",
            "network"),
    _mutant("pause_shared", "outages begin in a period, however long the one before was",
            "chain/network/outages.py", "if memory[1] > 0.0 else numbers[0])",
            "if memory[1] > 0.0 else max(numbers[0] - numbers[1] / 2.0, 0.0))", "network"),
    _mutant("times_per_burst", "good and bad times change once a burst",
            "chain/network/gilbert_elliott.py",
            "memory[1] = 1.0 if chances[0] < border else 0.0",
            "memory[1] = memory[1] if memory[0] >= 1.0 else float(chances[0] < border)",
            "network"),
    _mutant("never_stopped", "a tank lets the command go on against any force",
            "chain/passivity/tank.py", "command, numbers[5], period)", "command, 1e9, period)",
            "passivity"),
    _mutant("told_twice", "what was told to the other side is also spent here", _TDPA,
            "        port[MARGIN] -= told\n", "        port[MARGIN] -= 0.0\n", "passivity"),
    _mutant("forgiven", "what the arm owes is forgiven", _TDPA,
            "    tell(port, 0.0)\n", "    port[MARGIN] = max(port[MARGIN], 0.0)\n"
            "    tell(port, 0.0)\n", "passivity"),
    _mutant("overdrawn", "the arm may go twice as far as was paid for", _HELD,
            "    length = norm(lead)\n", "    length = 0.5 * norm(lead)\n", "passivity"),
    _mutant("turned_free", "turns against a torque cost nothing", _HELD,
            "    if excess > 0.0:", "    if excess > 1e9:", "passivity"),
    _mutant("turns_uncounted", "what torques took and gave is not counted as paid",
            "chain/passivity/slave_side.py", "        came += turned\n", "", "passivity"),
    _mutant("wall_apart", "with passivity the fixture's wall gives what it likes",
            "chain/mapping/reflection.py", "    if p.law != 0.0:\n        _hold_wall",
            "    if p.law > 1e9:\n        _hold_wall", "passivity"),
    _mutant("drag_missing", "the hand never pays for a slave that has nothing", _TDPA,
            "drag = numbers[2] * min", "drag = 0.0 * min", "passivity"),
    _mutant("wave_cheap", "a wave costs half of its energy", "chain/passivity/wave.py",
            "return 0.5 * square * share", "return 0.25 * square * share", "wave"),
    _mutant("wave_echo", "the hand's wave does not take in the one that came",
            "chain/passivity/wave.py", "at_slave * led[i] - wave[i] * period",
            "at_slave * led[i]", "wave"),
    _mutant("wave_unpaid", "a wave leads the arm against the force without being paid for", _HELD,
            "if inwards > left and size > least:", "if inwards > 1e9:", "wave"),
    _mutant("wave_half", "half of what is unpaid is taken back from a wave's command", _HELD,
            "back = force[i] * (inwards - left)", "back = 0.5 * force[i] * (inwards - left)",
            "wave"),
    _mutant("chain_ahead", "a pose of a carrier from the future moves an imported frame",
            "session/exchange/transform_chain.py", 'side="right") - 1', 'side="right")',
            "import_bags"),
    _mutant("yields_late", "the tip yields by half of its force", _YIELD,
            "p.force_gain * row.slave_measured_cf[i]",
            "0.5 * p.force_gain * row.slave_measured_cf[i]", "impedance"),
    _mutant("yields_far", "the tip yields without an end", _YIELD,
            "if square > p.largest_way * p.largest_way:", "if square > 1e9:", "impedance"),
    _mutant("fourth_turned", "the hand's force leads the slave the wrong way",
            "chain/mapping/reflection.py", "-p.lead_gain * p.sign[i]", "p.lead_gain * p.sign[i]",
            "impedance"),
    # slave
    _mutant("creeping", "a bristle bends on where it should slip", "slave/friction.py",
            "s.bent[i] = min(max(bent, -most), most)", "s.bent[i] = bent", "friction"),
    _mutant("resting", "friction wanders at rest", "slave/friction.py",
            "if p.wander[i] > 0.0 and s.slipped[i] > 0.0:", "if p.wander[i] > 0.0:", "friction",
            "hardware_plant"),
    _mutant("winding_up", "the integral grows while the drive is at its limit", _PID,
            "if abs(effort) <= limit or effort * error < 0.0:", "if effort == effort:", "pid"),
    _mutant("weight_lost", "the setpoint's weight is always 1", _PID,
            "return weight * near + (1.0 - weight) * memory[_LAGGED]", "return near",
            "setpoint_weight"),
    _mutant("lost_arm", "an arm that was lost is led from where its setpoint was", "slave/step.py",
            "        s.must_join = 1\n", "        s.must_join = 0\n", "feedback"),
    _mutant("left_behind", "an arm that its server left goes on telling where it is",
            "slave/bridges/arm_bridge.py", "or self._is_left(now_ns):", "or False:", "arm_bridge"),
    _mutant("rejoins_moved", "an arm that somebody moved goes back to its setpoint by itself",
            "slave/bridges/leading.py", "or not is_still or not (off <= self.tolerance).all()",
            "or not is_still", "arm_bridge"),
    _mutant("rejoins_fast", "an arm catches up with its setpoint at its rated speed",
            "slave/bridges/leading.py", "elapsed, _SLOWLY)", "elapsed)", "arm_bridge"),
    _mutant("way_jumps", "the arm goes from command to command within a tick", _WAY,
            "span = max(1, round(period_ns * 1e-9 / dt))", "span = 1", "interpolation"),
    _mutant("way_bends", "a way of another length keeps its acceleration", _WAY,
            "bend * longer * longer", "bend * longer", "interpolation"),
    _mutant("pulling", "the damper of a contact pulls the tip in", _CONTACT,
            "if depth <= 0.0 or normal_force <= 0.0:", "if depth <= 0.0:", "contacts", "world"),
    _mutant("glued", "dry friction of an object holds whatever pulls", _CONTACT,
            "share = most / asked if asked > most else 1.0", "share = 1.0", "contacts", "world"),
    _mutant("never_holds", "a bristle forgets its bend at every tick", _CONTACT,
            "s.stuck[k] = (push * s.normal[k] - force[k]) / p.world_stiffness",
            "s.stuck[k] = 0.0", "contacts", "world"),
    _mutant("lever_lost", "what a point behind the tip feels makes no torque", _CONTACT,
            "felt[3 + k] += lever[a] * force[b] - lever[b] * force[a]", "felt[3 + k] += 0.0",
            "tool_points"),
    _mutant("bristle_shared", "all points of a tool bend one bristle", _CONTACT,
            "_touch_at(p, contacts[point], arm,", "_touch_at(p, contacts[0], arm,",
            "tool_points"),
    _mutant("underflow", "next to the middle of a ball the way out is of any length",
            "slave/world/sphere.py", "if distance > MIDDLE:", "if distance > 0.0:", "world"),
    _mutant("hole_closed", "the wall of a hole pushes outwards", "slave/world/hole.py",
            "distance, way_out, way_up = radius - out, -1.0, 0.0",
            "distance, way_out, way_up = radius - out, 1.0, 0.0", "hole"),
    _mutant("no_cut", "tissue ahead of a needle resists without a bound", _PUNCTURE,
            "min(max(cutting, 0.0), p.cutting_force)", "max(cutting, 0.0)", "puncture"),
    _mutant("side_door", "a needle enters its channel from anywhere", _PUNCTURE,
            "return along >= 0.0 if s.gap >= 0.0 else abs(along - s.gap) <= p.hole_radius",
            "return True", "puncture"),
    _mutant("shaft_glued", "the shaft's friction has no bound", _PUNCTURE,
            "s.drawn = min(max(drawn, -most), most)", "s.drawn = drawn", "puncture"),
    _mutant("button_led", "friction of a button is given energy by its bound", _BUTTON,
            "_STIFFER = 10.0", "_STIFFER = 0.2", "button"),
    _mutant("button_up", "a button is free as soon as it leaves the stop", _BUTTON,
            "elif depth <= p.click_travel:", "else:", "button"),
    _mutant("press_scored_twice", "a press is scored again as soon as the stop is left",
            _BUTTON, "is_down | (depths <= parameters.click_travel)",
            "is_down | (depths < parameters.stroke)", "button"),
    _mutant("ridge_pushes", "at a ridge of a mesh the push is no gradient", "slave/world/mesh.py",
            "return value * slope", "return value", "mesh"),
    _mutant("inertia_still", "the observer takes inertia for what it was", _OBSERVER,
            "turned += (inertia - s.last_inertia[i, j])", "turned += 0.0", "force_observer"),
    _mutant("noise_repeats", "a sensor's noise is the same at every tick", "slave/force_sensor.py",
            "s.next_noise += p.has_noise", "s.next_noise += 0 * p.has_noise", "force_sensor"),
    _mutant("loss_masked", "what numbers tell of a button hides the loss of another's messages",
            "slave/operation/presses.py", "count > self._told", "count > self.lost", "presses"),
    _mutant("stop_queues", "the page's stop waits for the messages of all pages",
            "console/hooks.py", "Front(opened, answers.paths,", "Front(opened, frozenset(),",
            "tests/scenario/test_console_hostile.py"),
    _mutant("feed_loss_untold", "what a loop could not feed is not counted", "nodes/feed.py",
            "lost = number - self._last.get(index, number - 1) - 1", "lost = 0", "feed"),
    _mutant("any_releases", "any stop button releases what another one pressed",
            "slave/operation/presses.py", "self._holders.pop(sender, None)",
            "self._holders.clear()", "presses"),
    _mutant("one_beats_for_all", "one stop button that beats speaks for those that fell silent",
            "slave/operation/presses.py", "return min(self._heard_ns.values(), default=None)",
            "return max(self._heard_ns.values(), default=None)", "presses"),
    _mutant("late_button", "what a button said before it was found is nothing",
            "slave/operation/presses.py", "number - 1 if is_idle else 0", "number - 1", "presses"),
    _mutant("resume_early", "resume is taken while the arm moves", "slave/operation/states.py",
            "and s.is_moving:", "and s.is_moving > 1:", "operation_states"),
    _mutant("part_untold", "a verdict does not name a part that is not known",
            "evaluation/verdict.py", "    _missing, _drift, _following,", "    _drift, _following,",
            "verdict"),
    _mutant("loss_untold", "a verdict does not name lost messages", "evaluation/verdict.py",
            'for name in ("gaps", "count", "lost")', 'for name in ("lost", "count", "gaps")',
            "evaluation_graph"),
    # jaw
    _mutant("jaw_moves", "a stopped arm's jaw follows the hand", _JAW,
            " and row.slave_operation[_STATE] == _ENABLED", "", "jaw"),
    _mutant("jaw_deaf", "the jaw goes on to the last command of a hand that fell silent", _JAW,
            "is_heard = s.told_ns != 0 and row.now_ns - s.heard_ns <= p.timeout_ns",
            "is_heard = s.told_ns != 0", "jaw"),
    _mutant("jaw_blind", "a jaw that nobody sees is led on", _JAW,
            "is_seen = s.sampled_ns != 0 and row.now_ns - s.seen_ns <= p.timeout_ns",
            "is_seen = True", "jaw"),
    _mutant("jaw_back", "a jaw that others opened while it was silent closes again", _JAW,
            "if row.slave_jaw_setpoint_js_ns == topics.NO_COMMAND_NS or is_elsewhere:",
            "if row.slave_jaw_setpoint_js_ns == topics.NO_COMMAND_NS:", "jaw"),
    _mutant("jaw_no_number", "a command that is no number leads the jaw", _JAW,
            "is_sound = math.isfinite(row.slave_jaw_servo_jp[0])", "is_sound = True", "jaw"),
    _mutant("jaw_lets_go", "after a stop the jaw opens for a hand that was opened meanwhile", _JAW,
            "s.is_led = 1 if s.lowest <= s.setpoint + _NEAR else 0", "s.is_led = 1", "jaw"),
    _mutant("jaw_snaps", "after a stop the jaw closes for a hand that was closed meanwhile", _JAW,
            "1 if s.highest >= min(s.setpoint - _NEAR, wanted + _CLOSING) else 0", "1", "jaw"),
    _mutant("jaw_forgets", "what was commanded before a stop counts after it", _JAW,
            "s.is_led, s.lowest, s.highest = 0, math.inf, -math.inf", "s.is_led = 0", "jaw"),
    _mutant("jaw_braked", "brakes of the arm lead a gripper off its grip", _GRIPPER,
            "        return False\n", "        return super()._is_braked()\n", "jaw_bridge"),
    _mutant("jaw_loosened", "a gripper that was not led for a while is led from its angle",
            "slave/bridges/leading.py", "if not (self._presses and stays):", "if True:",
            "jaw_bridge"),
    _mutant("jaw_unasked", "a gripper is commanded before the hand is", _GRIPPER,
            'if self.signals["slave_jaw_setpoint_js_ns"] <= NO_COMMAND_NS:', "if False:",
            "jaw_bridge"),
    _mutant("jaw_unplugged", "a gamepad that was unplugged opens the jaw when it comes back",
            "chain/devices/pilot.py", "        self._leads_jaw = False\n", "", "devices"),
    _mutant("jaw_sticks", "friction of the pads has no bound", _GRIP,
            "share = most / apart if apart > most else 1.0", "share = 1.0", "jaw"),
    _mutant("jaw_opens", "an object that the hand lets go of counts as dropped", _GRIP,
            "if is_lost and not _is_opened(s) and", "if is_lost and", "jaw"),
    _mutant("peg_soft", "a peg holds nothing across its axis", _GRIP,
            "    if far <= p.clearance:\n        return 0.0", "    if True:\n        return 0.0",
            "jaw"),
    _mutant("peg_creeps", "a block that slides round its peg gets away from it", _GRIP,
            "    if far > p.clearance:\n", "    if False:\n", "jaw"),
    _mutant("peg_short", "a lifted block is off its peg at any height", _GRIP,
            "if s.object[2] >= top:", "if s.object[2] > p.place[2]:", "jaw"),
    _mutant("peg_wide", "a block comes onto a peg that it misses", _GRIP,
            "<= p.clearance:\n            return k", "<= 2.0 * p.clearance:\n            return k",
            "jaw"),
    _mutant("peg_flat", "along the table a block comes onto a peg", _GRIP,
            "elif before >= top:", "elif s.peg == _NONE:", "jaw"),
    _mutant("peg_pulls_all", "a peg's pull is all of the friction, that for the weight too", _GRIP,
            "* s.force * cut / left", "* s.force", "jaw"),
    _mutant("peg_held", "a block that is held on the table has dropped", _GRIP,
            " and not (s.is_between and s.force > 0.0)", "", "jaw"),
    _mutant("peg_shared", "a block is on the peg of the one that moved before", _GRIP,
            "s.number, s.peg = i, s.homes[i]", "s.number = i", "jaw"),
    _mutant("block_back", "a block stands where it was as soon as another one moves", _GRIP,
            "            copy(s.object, s.objects[7 * s.number : 7 * s.number + 7])\n", "", "jaw"),
    # scores
    _mutant("transfer_first", "every transfer begins at the first grip", "evaluation/pairing.py",
            "begins_ns[i - 1]", "begins_ns[0]", "evaluation_scores"),
    _mutant("transfer_all", "the score counts transfers from before it begins", _TRANSFER,
            "counts = self._last - self._first", "counts = self._last", "evaluation_scores"),
    _mutant("jaw_delay", "a grip's delay begins at the end of the hand's closing", _JAW_SCORE,
            "closes[1:] & ~closes[:-1]", "~closes[1:] & closes[:-1]",
            "evaluation_scores"),
    _mutant("delay_asked", "a delay beyond what was asked for is no concern",
            "evaluation/verdict.py", "(whole - asked) / _LATENCY_MS", "(asked - asked)", "verdict"),
    _mutant("holes_lost", "holes of a user's file count as messages lost in every topic",
            "evaluation/stamps.py", ", side=\"left\") > before", ", side=\"left\") >= before",
            "import_tables"),
    _mutant("jaw_grips_all", "the score counts grips from before it begins", _JAW_SCORE,
            "counts = self._last - self._first", "counts = self._last", "evaluation_scores"),
    _mutant("touch_drop", "a fall of the force over a pause counts as a puncture", _TOUCH,
            "falls = -np.diff(forces)[times <= _NEXT_NS]", "falls = -np.diff(forces)",
            "evaluation_scores"),
    _mutant("touch_count", "every sample in touch counts as one", _TOUCH,
            "np.sum(touches & ~before)", "np.sum(touches)", "evaluation_scores"),
    _mutant("centre_mean", "the largest miss of a remote centre is its RMS", _CENTRE_SCORE,
            "RemoteCentreScore(off.rms, off.max", "RemoteCentreScore(off.rms, off.rms",
            "evaluation_scores"),
    _mutant("centre_begin", "what was before the session begins counts", _CENTRE_SCORE,
            "counts = poses.stamp_ns >= self._begin_ns", "counts = poses.stamp_ns >= 0",
            "evaluation_scores"),
    _mutant("quantile_low", "a percentile is that of a sample less", "evaluation/accumulators.py",
            "math.ceil(share * self.count)", "math.floor(share * self.count)",
            "evaluation_statistics"),
    _mutant("upright_lost", "roll and yaw count where they are not defined",
            "evaluation/tracking.py", "difference[is_degenerate, ::2] = np.nan", "pass",
            "evaluation_scores"),
    # graph, parts, nodes, console
    _mutant("delays_largest", "of delays that fit one link the longest counts", "graph/graph.py",
            "return sum(d.seconds for d in fitting if d.reader in {\"\", reader.name})",
            "return max([d.seconds for d in fitting if d.reader in {\"\", reader.name}] + [0.0])",
            "graph"),
    _mutant("delays_in_row", "of delays in a row the longest counts", "session/notes.py",
            "return sum(\n        link.delay", "return max(\n        link.delay", "contacts"),
    _mutant("every_last", "what holds for every node wins over what one says", "graph/layers.py",
            "key=lambda item: item[0] != _EVERY", "key=lambda item: 0", "configuration"),
    _mutant("peace_made", "a conflict of senders is forgotten with the owner", "nodes/sender.py",
            "self.conflict = self.conflict or self.has_other", "self.conflict = self.has_other",
            "sender"),
    _mutant("slow_restarts", "slow commands start from the slave's joints each time",
            "chain/mapping/inverse_kinematics.py", "max(p.timeout_ns, 2 * elapsed_ns)",
            "p.timeout_ns", "inverse_kinematics"),
    _mutant("upright_pose", "only the pose itself says whether roll and yaw are defined",
            "evaluation/tracking.py",
            "np.maximum(np.abs(angles[:, 1]), np.abs(others[:, 1]))", "np.abs(angles[:, 1])",
            "evaluation_statistics"),
    _mutant("delay_of_all", "a delay for one reader is one for all", "graph/graph.py",
            'if d.reader in {"", reader.name}', "", "graph"),
    _mutant("part_replaced", "a part takes the name of another without being asked",
            "base/registry.py", "if not is_ours and name in self.names():",
            "if not is_ours and name in ():", "registry"),
    _mutant("overtaken", "a message that was overtaken counts as lost", "nodes/sender.py",
            "if number > self._number:", "if number != self._number:", "sender"),
    _mutant("for_ever", "a start that gets no further is waited for", "nodes/starter.py",
            "time.monotonic() - self._last > self._patience", "time.monotonic() < 0.0", "starter"),
    _mutant("held_on", "who takes control holds what the one before held", "console/drivers.py",
            "self._driver, self._holds = page, False", "self._driver = page", "console_drivers"),
    _mutant("two_hosts", "a request under two names is answered", "console/guard.py",
            "if len(hosts) != 1 or not", "if not", "console_guard"),
    _mutant("mesh_outside", "a URDF leads to files anywhere", "robots/visuals.py",
            "if not real.is_relative_to(root.resolve()):", "if False:", "looks"),
    _mutant("gap_long", "a pause of a minute is drawn as a line", "console/tails.py",
            "time > before + _GAP", "time > before + 60.0", "console_scene", "console_history"),
    _mutant("page_stands", "a page is woken from any thread", "console/hooks.py",
            "self.message_event = Wake()", "pass", "tests/scenario/test_console_server.py"),
    _mutant("guest_left", "who comes in while the console ends is left there", "console/hooks.py",
            "return _Serving(", "return ws.serve(", "console_port"),
)  # fmt: skip
"""All of them."""


_PATIENCE = 300.0
"""Time that the tests of one mutant take at most [s]; whole ones take a third of it."""


def found_by(mutant: Mutant) -> str:
    """Test that finds a mutant, or that its tests come to no end; empty if none does."""
    own = str(tree(mutant))
    env = os.environ | {"PYTHONPATH": own, "TELEOP_KERNELS": f"{own}/kernels"}
    command = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", *mutant.rows]
    with subprocess.Popen(
        command, cwd=ROOT, env=env, stdout=subprocess.PIPE, text=True, start_new_session=True
    ) as tests:
        try:
            said = tests.communicate(timeout=_PATIENCE)[0]
        except subprocess.TimeoutExpired:
            os.killpg(tests.pid, signal.SIGKILL)
            return f"no end within {_PATIENCE:.0f} s"
    lines = [line for line in said.splitlines() if line.startswith(("FAILED", "ERROR"))]
    return lines[0].partition(" - ")[0] if tests.returncode == 1 and lines else ""


def main() -> int:
    """Test the mutants that are named, or all; 0 if each was found."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("names", nargs="*", help="mutants (default: all)")
    parser.add_argument("--list", action="store_true", dest="is_list")
    asked = parser.parse_args()
    chosen = [one for one in CODE_MUTANTS if not asked.names or one.name in asked.names]
    if unknown := set(asked.names) - {one.name for one in chosen}:
        parser.error(f"no mutant {', '.join(sorted(unknown))}; see --list")
    if asked.is_list:
        for one in CODE_MUTANTS:
            print(f"{one.name:15} {one.text} ({', '.join(one.rows)})")
        return 0
    missed = 0
    for one in chosen:
        begin = time.monotonic()
        test = found_by(one)
        missed += not test
        took = time.monotonic() - begin
        print(f"{'found' if test else 'MISSED'} {one.name} ({took:.0f} s): {test}", flush=True)
    print(f"{len(chosen) - missed} of {len(chosen)} mutants found")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
