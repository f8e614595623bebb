"""ROS domains: what is none is refused in one line, wherever it is named."""

import subprocess
import sys
from pathlib import Path

import pytest

from teleop_core.base.errors import ParameterError
from teleop_core.commands import cli
from teleop_core.middleware.domains import checked_domain, domain_of_environment

NONE = ["abc", "-1", "233", "300", "1e2", "0x5", "²", " ", "1" + 4300 * "0"]


@pytest.mark.parametrize("text", NONE)
def test_what_is_no_domain_is_refused_with_those_that_are(text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", text)
    for ask in (domain_of_environment, lambda: checked_domain("ROS_DOMAIN_ID", text)):
        with pytest.raises(ParameterError, match=r"ROS_DOMAIN_ID is .* 0 to 232"):
            ask()


def test_every_domain_is_taken_and_an_empty_variable_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    assert [checked_domain("domain", str(number)) for number in range(233)] == list(range(233))
    monkeypatch.setenv("ROS_DOMAIN_ID", "")
    assert domain_of_environment() is None
    monkeypatch.delenv("ROS_DOMAIN_ID")
    assert domain_of_environment() is None


@pytest.mark.parametrize("domain", ["-1", "300", "abc"])
@pytest.mark.parametrize("words", [["stop"], ["operate"], ["conformance", "slave"], ["console", "--attach"]])
def test_every_command_with_a_domain_refuses_what_is_none(
    words: list[str], domain: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main([*words, "--domain", domain]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "--domain" in line
    assert "0 to 232" in line


@pytest.mark.parametrize(
    "words",
    [
        ["stop"],
        ["operate", "reset"],
        ["conformance", "slave"],
        ["live", "--composed", "--duration", "1", "--out", "new"],
        ["drill", "stop_topic"],
    ],
    ids=lambda words: words[0],
)
def test_every_command_of_a_session_refuses_a_variable_that_names_no_domain(
    words: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("rclpy")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("ROS_DOMAIN_ID", "300")
    assert cli.main(words) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"teleop {words[0]}: ROS_DOMAIN_ID is '300', must be")
    assert list(tmp_path.iterdir()) == []


def test_a_node_ends_with_a_line_where_the_variable_names_no_domain(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("rclpy")
    monkeypatch.setenv("ROS_DOMAIN_ID", "abc")
    command = [sys.executable, "-m", "teleop_core.nodes", "slave"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=100)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("ROS_DOMAIN_ID is 'abc', must be")
    assert len(done.stderr.splitlines()) == 1
