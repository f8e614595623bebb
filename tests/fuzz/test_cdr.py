"""Bytes on every topic that is subscribed to: numbers of the right shape come out, or a reason."""

import math
from collections.abc import Callable

import pytest
from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy

from accepted import why_refused
from fuzzing import damaged, fuzz
from present import present
from teleop_core.bags import messages
from teleop_core.graph import STAGES, topics

JOINTS = ("theta1", "theta2", "d3", "theta4", "theta5", "theta6")
READ = {topic.name: topic for name in STAGES.names() for topic in STAGES.find(name).reads}
STREAMS = [topic for topic in READ.values() if topic.kind is not topics.Kind.REPORT]
REPORTS = [topic for topic in READ.values() if topic.kind is topics.Kind.REPORT]
PARTS = len(STREAMS) + len(REPORTS) + 1
STAMPS = st.one_of(st.none(), st.integers(0, 2**62))


def broken(whole: bytes) -> SearchStrategy:
    return st.one_of(st.binary(max_size=400), damaged(whole), st.just(whole))


def streams(topic: topics.Topic) -> Callable[..., None]:
    """Test of what an input does with the bytes of a stream."""
    names, width = topic.names(JOINTS), topic.width(len(JOINTS))
    form = messages.layout(topic, JOINTS)
    whole = form.encode_one(7, present(form.decode_one(form.template.tobytes()))[1])

    @fuzz("CDR", PARTS, data=broken(whole), last_ns=STAMPS)
    def case(data: bytes, last_ns: int | None) -> None:
        found = form.decode_one(data) or messages.read_any(topic.kind, data, names)
        if isinstance(found, messages.Refusal):
            return
        stamp_ns, values = found
        assert values.shape == (width,)
        reason = why_refused(topic.kind, stamp_ns, values, last_ns)
        if reason is None:
            assert all(map(math.isfinite, values.tolist()))
            assert last_ns is None or stamp_ns > last_ns
        messages.discover(topic.kind, data)

    return case


@pytest.mark.parametrize("topic", STREAMS, ids=lambda topic: topic.name)
def test_any_bytes_of_a_stream_give_sound_numbers_or_a_reason(topic: topics.Topic) -> None:
    streams(topic)()


def reports(columns: tuple[str, ...]) -> Callable[..., None]:
    """Test of what is made of the bytes of a report."""
    whole = messages.report(5, "slave_sim", 1, "fine", dict.fromkeys(columns, "1.5"))

    @fuzz("CDR", PARTS, data=broken(whole))
    def case(data: bytes) -> None:
        found = messages.read_numbers(data, columns)
        assert isinstance(found, messages.Refusal) or found[1].shape == (len(columns),)
        if found is messages.Refusal.MALFORMED:
            with pytest.raises(ValueError, match="bytes is no valid"):
                messages.read_reports(data)
        else:
            messages.read_reports(data)

    return case


@pytest.mark.parametrize("topic", [*REPORTS, topics.DIAGNOSTICS], ids=lambda topic: topic.name)
def test_any_bytes_of_a_report_give_numbers_or_a_reason(topic: topics.Topic) -> None:
    reports(topic.columns or ("rate_hz", "late"))()
