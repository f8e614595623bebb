"""Stages of an installed package in the processes of a session."""

import signal
import textwrap
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from links import (
    ENTRIES,
    SETTINGS,
    STAGES,
    WATCHED,
    assert_delay_is_seen_in_the_latency,
    assert_stages_run_between_ours,
    is_enough,
)
from live_process import CALM, LiveProcess, wait_until

if TYPE_CHECKING:
    from ros.conftest import Peer

pytestmark = [pytest.mark.ros, pytest.mark.slow]


def test_stages_of_an_installed_package_sum_and_run_between_ours(peer: "Peer", tmp_path: Path) -> None:
    site = tmp_path / "site"
    about = site / "my_stages-1.0.dist-info"
    about.mkdir(parents=True)
    (site / "my_stages.py").write_text(textwrap.dedent(STAGES))
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: my-stages\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text(textwrap.dedent(ENTRIES))
    listeners = [peer.listen(topic) for topic in WATCHED]
    session = LiveProcess(
        tmp_path,
        scenario="free_motion",
        env={"ROS_DOMAIN_ID": peer.domain, "PYTHONPATH": str(site)},
        settings=(*SETTINGS, "operator.approach_time=1.0", CALM),
    )

    def has_enough() -> bool:
        assert session.process.poll() is None, session.text
        return is_enough(*listeners)

    try:
        session.wait_running()
        wait_until(has_enough, "enough samples", 300.0)
        session.signal(signal.SIGINT)
        assert session.wait() == 0, session.text
    finally:
        session.close()
    recorded = session.recorded()
    assert_delay_is_seen_in_the_latency(recorded)
    assert_stages_run_between_ours(recorded)
