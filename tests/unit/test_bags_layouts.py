"""Layouts: the bytes of messages, against rosbags' serialiser."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from present import present
from teleop_core.bags import messages, ros_types, walk
from teleop_core.bags.layouts import Layout, discover, layout, layout_of
from teleop_core.graph import topics
from teleop_core.kernels.geometry import Array

JOINTS = ("theta1", "d2", "a_rather_long_joint_name")
NAMES = st.text(st.characters(codec="utf-8", exclude_characters="\0"), min_size=1, max_size=9)
FIXED = [kind for kind in topics.Kind if kind is not topics.Kind.REPORT]


def names_of(kind: topics.Kind) -> tuple[str, ...]:
    """Names of the joints that its messages have."""
    return topics.JAW if kind is topics.Kind.JAW else JOINTS


def rosbags_message(kind: topics.Kind, stamp_ns: int, values: Array, names: tuple[str, ...], frame_id: str) -> object:
    """The same message made by rosbags."""
    t = ros_types.typestore().types
    header = t["std_msgs/msg/Header"](t["builtin_interfaces/msg/Time"](*divmod(stamp_ns, 10**9)), frame_id)
    point, turn, vector = (t[f"geometry_msgs/msg/{n}"] for n in ("Point", "Quaternion", "Vector3"))
    v, kind_type = values.tolist(), t[kind.ros_type]
    if kind is topics.Kind.POSE:
        pose = t["geometry_msgs/msg/Pose"](point(*v[:3]), turn(*v[4:], v[3]))
        return kind_type(header, pose)
    if kind is topics.Kind.POSES:
        pose = t["geometry_msgs/msg/Pose"]
        rows = values.reshape(-1, 7).tolist()
        return kind_type(header, [pose(point(*row[:3]), turn(*row[4:], row[3])) for row in rows])
    if kind in {topics.Kind.TWIST, topics.Kind.WRENCH}:
        part = t["geometry_msgs/msg/" + ("Twist" if kind is topics.Kind.TWIST else "Wrench")]
        return kind_type(header, part(vector(*v[:3]), vector(*v[3:])))
    if kind is topics.Kind.BUTTONS:
        return kind_type(header, np.zeros(0, np.float32), values.astype(np.int32))
    parts = [values[i * len(names) : (i + 1) * len(names)] for i in range(3)]
    return kind_type(header, list(names), *parts)


@st.composite
def streams(draw: st.DrawFn) -> tuple[Layout, NDArray[np.int64], Array]:
    """A layout with stamps and values that fit it."""
    kind = draw(st.sampled_from(FIXED))
    most = 1 if kind is topics.Kind.JAW else 7
    names = tuple(draw(st.lists(NAMES, min_size=1, max_size=most, unique=True)))
    form = layout_of(kind, names, draw(NAMES | st.just("")))
    count = draw(st.integers(1, 4))
    stamps = draw(st.lists(st.integers(0, 2**31 * 10**9 - 1), min_size=count, max_size=count))
    number = st.integers(-(2**31), 2**31 - 1) if kind is topics.Kind.BUTTONS else st.floats(width=64)
    rows = [draw(st.lists(number, min_size=form.width, max_size=form.width)) for _ in stamps]
    return form, np.array(stamps, np.int64), np.array(rows, float)


@settings(deadline=None)
@given(streams())
def test_bytes_are_those_of_rosbags_and_every_way_of_reading_gives_back_what_was_encoded(
    stream: tuple[Layout, NDArray[np.int64], Array],
) -> None:
    form, stamps, values = stream
    rows = form.encode(stamps, values)
    assert form.matches(rows)
    for decoded, given_ in zip(form.decode(rows), (stamps, values), strict=True):
        np.testing.assert_array_equal(decoded, given_)
    for row, stamp, numbers in zip(rows, stamps.tolist(), values, strict=True):
        data = form.encode_one(stamp, numbers)
        assert data == row.tobytes()
        assert data == ros_types.serialise(rosbags_message(form.kind, stamp, numbers, form.joint_names, form.frame_id))
        assert discover(form.kind, data) is form
        message = ros_types.deserialise(data, form.kind.ros_type)
        for found in (form.decode_one(data), messages.read_values(form.kind, message, form.joint_names)):
            assert isinstance(found, tuple)
            assert found[0] == stamp
            np.testing.assert_array_equal(found[1], numbers)


@settings(deadline=None)
@given(streams(), st.data())
def test_any_other_constant_byte_is_noticed_one_by_one_and_in_batches(
    stream: tuple[Layout, NDArray[np.int64], Array], data: st.DataObject
) -> None:
    form, stamps, values = stream
    rows = form.encode(stamps, values)
    other = layout_of(form.kind, tuple(n + "x" for n in form.joint_names), form.frame_id + "x")
    same_size = np.resize(rows, (len(rows), other.size))
    assert not other.matches(same_size)
    begins = np.arange(len(rows)) * form.size
    found = walk.gather(rows.ravel(), begins, form.template, form.mask)
    np.testing.assert_array_equal(present(found), rows)
    begins = np.arange(len(rows)) * other.size
    assert walk.gather(same_size.ravel(), begins, other.template, other.mask) is None
    assert other.decode_one(same_size[0].tobytes()) is None


def padding_of(form: Layout) -> list[int]:
    """Bytes that hold neither constants nor numbers."""
    used = form.mask.astype(bool)
    for name in form._dtype.names or ():
        field, at = present(form._dtype.fields)[name][:2]
        used[at : at + field.itemsize] = True
    return np.flatnonzero(~used).tolist()


def test_messages_serialised_by_rclpy_are_understood() -> None:
    # JointState(name=[a, bb], position=[1, 2]) in slave_base at 1 s 2 ns, from rclpy 7.1.6: it ends
    # with eight bytes that belong to no field.
    positions: Any = bytes.fromhex(
        "0001000001000000020000000b000000736c6176655f62617365000002000000020000006100000003000000"
        "6262000002000000000000000000f03f00000000000000400000000000000000000000007d127402"
    )
    found = discover(topics.Kind.JOINTS, positions)
    assert found is not None
    assert (found.joint_names, found.frame_id) == (("a", "bb"), "slave_base")
    stamp_ns, values = present(found.decode_one(positions))
    assert stamp_ns == 1_000_000_002
    assert values.tolist() == [1.0, 2.0]


@pytest.mark.parametrize("kind", FIXED)
def test_padding_may_hold_anything_since_rclpy_does_not_clear_it(kind: topics.Kind) -> None:
    form = layout_of(kind, names_of(kind), "slave_base")
    values = np.arange(form.width, dtype=float)
    clean = form.encode_one(7, values)
    dirty = bytearray(clean)
    for at in padding_of(form):
        dirty[at] = 0xA6
    dirty += b"\x7d\x12\x74\x02"  # what rclpy appends to a JointState without velocities
    assert bytes(dirty) != clean
    decoded = form.decode_one(bytes(dirty))
    assert decoded is not None
    np.testing.assert_array_equal(decoded[1], values)
    assert form.matches(np.frombuffer(bytes(dirty), np.uint8)[np.newaxis])
    assert discover(kind, bytes(dirty)) is form


@pytest.mark.parametrize("kind", FIXED)
def test_a_message_cut_short_is_not_decoded(kind: topics.Kind) -> None:
    form = layout_of(kind, names_of(kind), "slave_base")
    data = form.encode_one(7, np.zeros(form.width))
    for length in range(len(data)):
        assert form.decode_one(data[:length]) is None
        assert discover(kind, data[:length]) is None


def test_reports_have_no_layout() -> None:
    with pytest.raises(ValueError, match="teleop/state"):
        layout(topics.TELEOP_STATE, JOINTS)


def test_positions_alone_are_not_taken_for_a_whole_state() -> None:
    state = layout_of(topics.Kind.STATE, JOINTS, "f")
    data = layout_of(topics.Kind.JOINTS, JOINTS, "f").encode_one(1, np.zeros(3))
    assert state.decode_one(data + bytes(200)) is None
