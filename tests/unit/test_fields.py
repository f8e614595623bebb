"""Fields: a class says what a record has."""

from typing import Annotated

import numpy as np

from teleop_core.graph import Row, make_signals
from teleop_core.graph.topics import BY_NAME, PORTS_BETWEEN_ARMS
from teleop_core.kernels import Array, Fields, IntegerPerJoint, PerJoint, Vector3, fields_of, record
from teleop_core.kernels.layout import COUNT


class Base(Fields):
    place: Vector3
    count: int


class Joined(Base):
    share: float
    joints: PerJoint
    ticks: IntegerPerJoint
    jacobian: Annotated[Array, 3, "joints"]


def test_a_record_has_the_fields_of_its_class_and_of_its_bases_and_begins_at_zero() -> None:
    made = record(Joined, 6)
    names = ("place", "count", "share", "joints", "ticks", "jacobian")
    assert made.dtype.names == (COUNT, *names)
    shapes = [np.shape(made[name]) for name in names]
    assert shapes == [(3,), (), (), (6,), (6,), (3, 6)]
    assert all(not np.any(made[name]) for name in names)
    assert made.ticks.dtype == np.int64
    assert made.joints.dtype == np.float64


def test_a_field_that_two_bases_name_is_there_once() -> None:
    class Other(Fields):
        count: int

    class Both(Base, Other):
        pass

    assert [name for name, *_ in fields_of(Both)] == ["count", "place"]


def test_the_row_names_each_field_of_each_topic_and_no_other() -> None:
    topics = [topic for topic in (*BY_NAME.values(), *PORTS_BETWEEN_ARMS) if topic.width(1)]
    made = make_signals(topics, 1, (("answered_ns", "i8"),))
    assert {name for name, *_ in fields_of(Row)} == set(made.dtype.names) - {COUNT}
