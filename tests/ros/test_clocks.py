"""The clock that nodes go by."""

from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from ros.conftest import Peer

pytestmark = pytest.mark.ros


@pytest.mark.parametrize("name", ["slave", "recorder"])
def test_a_clock_of_others_is_refused_in_one_line_at_the_start(peer: "Peer", tmp_path: Path, name: str) -> None:
    node = peer.start(name, wait="", use_sim_time=True)
    assert node.wait() == 2
    (line,) = node.stderr.read_text().splitlines()
    assert f"{name}.use_sim_time is True, must be false: nodes step in real time" in line


def test_a_clock_of_others_is_refused_at_run_time(peer: "Peer") -> None:
    peer.start("slave")
    (result,) = peer.set("slave", use_sim_time=True)
    assert not result.successful
    assert "nodes step in real time" in result.reason
