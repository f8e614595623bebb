"""Queries: test the existence of a topic, its type, its numbers and stamps, and whether it reaches every reader."""

from itertools import pairwise
from typing import Any

import numpy as np

from teleop_core.bags.messages import SECOND_NS
from teleop_core.middleware.platform import Endpoint
from teleop_drill.conformance.crtk_topics import STATES, CrtkTopic, Finding, Group, RowResult
from teleop_drill.nodes.conformance_arm import ArmClient, numbers_of, stamp_of

_LOOK = 0.5  # time in which messages are counted [s]
_FIRST = 2.5  # time within which the first message must arrive [s]
_OLD = 1.0  # largest age of a measurement [s]
_AHEAD = 0.05  # largest time by which the clock of the sender may be ahead [s]; clocks of a network differ by less
_UNIT = 1e-3


def look(arm: ArmClient, row: CrtkTopic) -> Finding:
    """Finding of one row, without any command to the arm."""
    is_command = row.group is Group.COMMAND or row.name == "state_command"
    ends = arm.readers(row.name) if is_command else arm.publishers(row.name)
    side = "reader" if is_command else "publisher"
    if not ends:
        verdict = RowResult.FAILED if row.is_required else RowResult.ABSENT
        return Finding(row, verdict, "" if verdict is RowResult.ABSENT else f"no {side}")
    wrong = {end.ros_type for end in ends} - {row.ros_type}
    if wrong:
        return Finding(row, RowResult.FAILED, ", ".join(sorted(wrong)), f"must be {row.ros_type}")
    if is_command:
        return Finding(row, RowResult.OK, f"{len(ends)} {side}{'s' * (len(ends) > 1)}")
    return _listen(arm, row, ends)


def _listen(arm: ArmClient, row: CrtkTopic, ends: list[Endpoint]) -> Finding:
    """Result for a topic with publishers of the right type."""
    messages: list[Any] = []
    tap = arm.tap(row.name)
    arm.wait(lambda: tap.read(messages.append) > 0, _FIRST)
    begin_ns, before = arm.platform.monotonic_ns(), tap.count
    while (looked := (arm.platform.monotonic_ns() - begin_ns) / SECOND_NS) < _LOOK:
        tap.read(messages.append)
        arm.pause(0.01)
    rate = (tap.count - before) / looked
    arm.untap(row.name)
    if not messages:
        return Finding(row, RowResult.FAILED, "no message", f"no message came within {_FIRST:g} s")
    found = f"{rate:.0f} Hz" if rate > 0 else "1 message"
    faults = [*_stamps(row, messages, arm.platform.time_ns()), *_content(row, messages)]
    if faults:
        return Finding(row, RowResult.FAILED, found, faults[0])
    if len(ends) > 1:
        return Finding(row, RowResult.FAILED, found, f"{len(ends)} publishers: the arm must have one owner")
    if not any(end.is_reliable for end in ends):
        note = "offered best effort: ordinary clients, which are reliable, receive nothing"
        return Finding(row, RowResult.FAILED, found, note)
    return Finding(row, RowResult.OK, found)


def _stamps(row: CrtkTopic, messages: list[Any], now_ns: int) -> list[str]:
    """Text about faults of the stamps."""
    if not hasattr(messages[0], "header"):
        return []
    stamps = [stamp_of(message) for message in messages]
    if 0 in stamps:
        return ["its stamp is 0, which means invalid"]
    if any(late < early for early, late in pairwise(stamps)):
        return ["its stamps go back"]
    return _age(stamps, 1e-9 * (now_ns - stamps[-1])) if row.name.startswith("measured") else []


def _age(stamps: list[int], age: float) -> list[str]:
    """Text about faults of the age [s] of the newest measurement, and of stamps that stand still."""
    if age < -_AHEAD:
        return [f"its stamp is {-age:.3g} s in the future: the sender uses another clock"]
    if age > _OLD + _LOOK:
        return [f"its stamp is {age:.3g} s old: the sender uses another clock or none"]
    if len(stamps) > 2 and stamps[0] == stamps[-1]:
        return ["its stamp does not move"]
    return []


def _content(row: CrtkTopic, messages: list[Any]) -> list[str]:
    """Text about faults of numbers, names and texts."""
    newest = messages[-1]
    if row.name == "operating_state":
        known = ", ".join(STATES)
        return [] if newest.state in STATES else [f"state {newest.state!r:.40}, must be of {known}"]
    vectors = numbers_of(newest)
    bad = [name for name, values in vectors.items() if not np.isfinite(values).all()]
    if bad:
        return [f"its {bad[0]} is not finite"]
    if hasattr(newest, "name"):
        return _joints(row, newest, vectors)
    if "quaternion" in vectors:
        length = float(np.linalg.norm(vectors["quaternion"]))
        if abs(length - 1.0) > _UNIT:
            return [f"its quaternion has length {length:.4g}, must be 1"]
    if row.name == "jacobian":
        dim = newest.layout.dim
        if len(dim) != 2 or dim[0].size != 6 or dim[0].size * dim[1].size != len(newest.data):
            return ["its layout is not that of 6 rows, one column for each joint"]
    return []


def _joints(row: CrtkTopic, message: Any, vectors: dict[str, np.ndarray]) -> list[str]:
    names = list(message.name)
    sizes = {len(values) for values in vectors.values() if len(values)}
    if not sizes:
        return ["it contains no numbers"]
    if len(sizes) > 1 or (names and {len(names)} != sizes):
        return [f"its vectors have different lengths: {sorted(sizes | {len(names)})}"]
    if not names and row.name == "measured_js":
        return ["it names no joints"]
    if len(set(names)) < len(names):
        return ["it names a joint twice"]
    return []
