"""Everything in a namespace: names, parameters, topics and recordings of real processes."""

from typing import TYPE_CHECKING

from teleop_core.nodes.start import taken_names

if TYPE_CHECKING:
    pass


def test_names_for_all_nodes_of_a_process_are_taken_out_and_others_are_kept() -> None:
    given = ["node", "-r", "__ns:=/x", "--ros-args", "-r", "__ns:=/lab", "--remap", "__node:=arm",
             "-r", "slave:__node:=other", "-r", "a:=b", "--", "-r", "__ns:=/y"]  # fmt: skip
    kept = ["node", "-r", "__ns:=/x", "--ros-args", "-r", "slave:__node:=other", "-r", "a:=b", "--", "-r", "__ns:=/y"]
    assert taken_names(given) == (kept, {"__ns": "/lab", "__node": "arm"})
    assert taken_names(kept) == (kept, {})
