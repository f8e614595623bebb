"""Remote control in simulated time: arms are stopped, told and let go on."""

from typing import TYPE_CHECKING

from teleop_core.graph.operation import State
from teleop_core.nodes.remote_control import RemoteControl

if TYPE_CHECKING:
    from peers import AnyPeer as Peer


def test_a_stop_is_said_until_every_arm_rests_and_each_goes_on_when_it_is_told(peer: "Peer") -> None:
    peer.start("slave", arm="left")
    peer.start("slave", arm="right")
    remote = RemoteControl(0, platform=peer.platform)
    assert set(remote.look()) == {"left", "right"}
    stopped = remote.stop()
    assert all(arm.values["state"] == State.FAULT for arm in stopped.values())
    assert all(0.0 <= arm.stopped_after < 0.5 for arm in stopped.values())
    assert not remote.command("enable", "left")[0]
    remote.close()
