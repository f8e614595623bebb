"""Graph: what follows from the stages, and what is refused before anything runs."""

from typing import Any

import numpy as np
import pytest

from teleop_core.base import NoParameters, UnknownNameError
from teleop_core.graph import BUILT_IN, STAGES, Graph, Stage, build_graph, topics
from teleop_core.graph.graph import Delay
from teleop_core.graph.topics import SLAVE_MEASURED_CP, SLAVE_SERVO_CP, Kind, Topic, in_force, passed_on

BASE = tuple(STAGES.find(name) for name in BUILT_IN)
ECHO = Topic("test/echo", Kind.POSE, passed_on("slave/measured_cp"))
LIMITED = Topic("test/limited_cp", Kind.POSE, passed_on("slave/servo_cp"))
PUSH = Topic("test/push", Kind.WRENCH, passed_on("slave/measured_cp"), adds_to="master/servo_cf")


def rest(parameters: Any, state: Any, signals: Any, dt: Any) -> None:
    """Step of a stage that does nothing."""


def stage(
    name: str = "echo",
    reads: tuple[Topic, ...] = (SLAVE_MEASURED_CP,),
    writes: tuple[Topic, ...] = (ECHO,),
    **more: Any,
) -> Any:
    return Stage(name, NoParameters, reads, writes, **{"step": rest, **more})


def limit(name: str = "limit", topic: Topic = LIMITED) -> Stage:
    return stage(name, (SLAVE_SERVO_CP,), (topic,), replaces=SLAVE_SERVO_CP)


def names(graph: Graph) -> list[str]:
    return [member.name for member in graph.members]


def feeds(graph: Graph, reader: str, port: str) -> list[str]:
    """Names of what arrives at a port of a stage of the default arm."""
    return [link.topic.name for link in graph.links if link.reader.name == reader and link.port.name == port]


# What follows.


@pytest.mark.parametrize("seed", range(3))
def test_order_of_a_tick_is_that_of_the_data_however_stages_are_listed(seed: int) -> None:
    order = np.random.default_rng(seed).permutation(len(BASE))
    assert names(Graph(tuple(BASE[i] for i in order))) == list(BUILT_IN)


def test_order_of_stages_decides_where_the_data_does_not() -> None:
    others = [
        stage(name, writes=(topic,))
        for name, topic in (("b", ECHO), ("a", Topic("test/other", Kind.POSE, passed_on("slave/measured_cp"))))
    ]
    assert names(Graph((*BASE, *others))) == [*BUILT_IN, "b", "a"]
    assert names(Graph((*BASE, *others[::-1]))) == [*BUILT_IN, "a", "b"]


def test_arms_follow_each_other_in_the_order_of_their_names_and_share_no_link() -> None:
    graph = Graph(BASE, ("right", "left"))
    assert all(link.writer.arm == link.reader.arm == link.topic.arm for link in graph.links)
    assert names(graph) == [*BUILT_IN, *(f"left/{name}" for name in BUILT_IN)]
    assert graph.topics[0] == topics.HAND_SERVO_CP
    assert "left/slave/servo_cp" in {topic.name for topic in graph.topics}


def test_replacing_stage_comes_between_writer_and_readers() -> None:
    graph = Graph((*BASE, limit()))
    assert names(graph) == [*BUILT_IN[:3], "limit", *BUILT_IN[3:]]
    assert feeds(graph, "inverse_kinematics", "slave/servo_cp") == ["test/limited_cp"]
    assert feeds(graph, "limit", "slave/servo_cp") == ["slave/servo_cp"]


def test_stages_that_replace_the_same_topic_follow_each_other_in_the_order_of_their_names() -> None:
    one, two = (Topic(f"test/{name}_cp", Kind.POSE, passed_on("slave/servo_cp")) for name in "ab")
    stages = limit("a", one), limit("b", two)
    for first, last in (stages, stages[::-1]):
        graph = Graph((*BASE, first, last))
        assert feeds(graph, first.name, "slave/servo_cp") == ["slave/servo_cp"]
        assert feeds(graph, last.name, "slave/servo_cp") == [first.writes[0].name]
        assert feeds(graph, "inverse_kinematics", "slave/servo_cp") == [last.writes[0].name]


def test_topic_that_adds_to_another_arrives_beside_it() -> None:
    graph = Graph((*BASE, stage("push", writes=(PUSH,))))
    assert feeds(graph, "haptic_master", "master/servo_cf") == ["master/servo_cf", "test/push"]
    added = [link.adds for link in graph.links if link.port.name == "master/servo_cf"]
    assert added == [False, True]


def test_chain_leads_from_the_hand_to_the_slave_and_passes_through_a_replacing_stage() -> None:
    assert "limit" in [name for name, _ in Graph((*BASE, limit())).chain()]
    assert [topic.name for _, topic in Graph(BASE).chain()] == [
        "master/measured_cp",
        "slave/servo_cp",
        "slave/servo_jp",
        "slave/setpoint_js",
    ]


def test_answer_like_its_input_that_nobody_reads_is_noted_unless_it_replaces_or_adds() -> None:
    push = stage("push", writes=(PUSH,))
    watch = stage("watch", writes=(Topic("test/x", Kind.WRENCH, passed_on("slave/measured_cp")),))
    assert Graph((*BASE, limit(), push, watch)).notes == ()
    (note,) = Graph((*BASE, stage())).notes
    assert "'echo' writes test/echo, which no stage reads; with replaces= it would reach the" in note
    assert note.endswith("readers of slave/measured_cp")
    reader = stage("reader", (ECHO,), ())
    assert Graph((*BASE, stage(), reader)).notes == ()


# Delays.


def test_delay_is_on_all_links_of_its_topic_and_arm_or_on_those_to_one_reader() -> None:
    everywhere = Graph(BASE, delays=(Delay("slave/servo_cp", 0.02),))
    delayed = {link.reader.name for link in everywhere.links if link.delay}
    assert delayed == {"inverse_kinematics"}
    both = stage("watch", (SLAVE_SERVO_CP,), (LIMITED,))
    one = Graph((*BASE, both), delays=(Delay("slave/servo_cp", 0.02, "watch"),))
    assert [(link.reader.name, link.delay) for link in one.links if link.delay] == [("watch", 0.02)]
    left = Graph(BASE, ("right", "left"), delays=(Delay("left/slave/servo_cp", 0.02),))
    assert [link.reader.arm for link in left.links if link.delay] == ["left"]


def test_delays_that_fit_one_link_add_up() -> None:
    delays = Delay("slave/servo_cp", 0.02), Delay("slave/servo_cp", 0.03, "inverse_kinematics")
    assert [link.delay for link in Graph(BASE, delays=delays).links if link.delay] == [0.05]


FORTH = Topic("test/forth", Kind.POSE, passed_on("test/back"))
BACK = Topic("test/back", Kind.POSE, passed_on("test/forth"))
CIRCLE = (stage("forth", (BACK,), (FORTH,)), stage("back", (FORTH,), (BACK,)))


def test_circle_runs_with_a_late_input_or_a_delay() -> None:
    late = stage("forth", (BACK,), (FORTH,), late=(BACK,))
    assert names(Graph((*BASE, late, CIRCLE[1])))[-2:] == ["forth", "back"]
    delayed = Graph((*BASE, *CIRCLE), delays=(Delay("test/forth", 0.001),))
    assert names(delayed)[-2:] == ["back", "forth"]


def test_stage_whose_stamp_is_of_a_command_in_force_gives_it_itself() -> None:
    assert stage(writes=(Topic("test/x", Kind.POSE, in_force("slave/servo_jp")),)).writes


def test_unknown_stage_is_refused_with_the_stages() -> None:
    with pytest.raises(UnknownNameError) as error:
        build_graph(stages=["limiter"])
    assert set(BUILT_IN) <= set(error.value.alternatives)


# Axis maps are checked with the parameters.
