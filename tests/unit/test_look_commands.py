"""Commands that look: what ``teleop info`` says of a recording is what another reader finds in it."""

from pathlib import Path

import pytest
from rosbags.highlevel import AnyReader

from teleop_core.commands.cli import main

EXAMPLE = Path(__file__).parents[2] / "bags" / "example"


def test_info_names_every_topic_with_its_type_and_count(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["info", str(EXAMPLE)]) == 0
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    told = {words[0]: (int(words[1]), words[2]) for words in lines if len(words) > 2 and words[1].isdigit()}
    with AnyReader([EXAMPLE]) as reader:
        found = {name.strip("/"): (info.msgcount, info.msgtype) for name, info in reader.topics.items()}
    assert told == found
