"""Start page: who may begin, end and read what, and what becomes of it."""

import shutil
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http import HTTPStatus
from pathlib import Path

import pytest

from patience import wait_until
from teleop_console.drivers import Drivers
from teleop_console.recordings import Recordings
from teleop_console.start import StartPage, Wish
from teleop_core.base.errors import ParameterError

EXAMPLE = Path(__file__).parents[2] / "bags" / "example"
URDF = Path(__file__).parents[2] / "examples" / "any_arm.urdf"
DRIVES, WATCHES, STRANGER = 0, 1, -1


@contextmanager
def opened(folder: Path) -> Iterator[tuple[StartPage, list[Wish]]]:
    """A start page that waits for one wish, which two pages look at."""
    drivers = Drivers()
    drivers.join(DRIVES)
    drivers.join(WATCHES)
    start, wishes = StartPage(drivers, folder), list[Wish]()
    waiting = threading.Thread(target=lambda: wishes.append(start.wait()))
    waiting.start()
    wait_until(lambda: start.is_open, "it waits", 60)
    try:
        yield start, wishes
    finally:
        if start.is_open:
            start.answer("/begin", {"operator": ["remote"]}, DRIVES)
        waiting.join()


def test_what_the_driver_begins_is_what_is_started_and_nothing_can_be_begun_beside_it(tmp_path: Path) -> None:
    asked = {"scenario": ["wall"], "operator": ["remote"]}
    with opened(tmp_path) as (start, wishes):
        assert start.answer("/begin", asked, DRIVES)[0] == HTTPStatus.OK
        wait_until(lambda: wishes, "it is started", 60)
        assert wishes == [Wish({"scenario": "wall", "operator": "remote"})]
        for path in ("/begin", "/show", "/run"):
            assert start.answer(path, asked, DRIVES)[0] == HTTPStatus.CONFLICT
        assert start.answer("/start", asked, DRIVES) == (HTTPStatus.OK, {})
        assert not start.is_ended
        start.answer("/end", {}, DRIVES)
        assert start.is_ended


@pytest.mark.parametrize("page", [WATCHES, STRANGER])
def test_page_that_watches_begins_ends_shows_and_runs_nothing(tmp_path: Path, page: int) -> None:
    shutil.copytree(EXAMPLE, tmp_path / "run_1")
    with opened(tmp_path) as (start, wishes):
        for path in ("/begin", "/end", "/show", "/run"):
            query = {"operator": ["remote"], "name": ["run_1"], "kind": ["export"]}
            assert start.answer(path, query, page) == (HTTPStatus.CONFLICT, "You watch. Take control first.")
        assert not wishes
        assert not start.is_ended
        assert start.told == ""


def test_what_cannot_be_started_is_refused_with_the_reason(tmp_path: Path) -> None:
    with opened(tmp_path) as (start, wishes):
        status, told = start.answer("/begin", {"operator": ["observer"]}, DRIVES)
        assert status == HTTPStatus.CONFLICT
        assert "teleop.stages=[task]" in str(told)
        assert not wishes


def body(data: bytes) -> Callable[[int], bytes]:
    """A body that is read as the server's front reads it."""

    def read(most: int) -> bytes:
        if len(data) > most:
            raise ValueError
        return data

    return read


def test_robot_that_is_dropped_can_be_chosen_and_replaces_no_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    data = URDF.read_bytes()
    with opened(tmp_path) as (start, wishes):
        for _ in range(2):
            told = start.answer("/robot", {"name": ["arm.urdf"]}, DRIVES, body(data))
            assert told == (HTTPStatus.OK, "robots/arm.urdf")
        status, _ = start.answer("/robot", {"name": ["arm.urdf"]}, DRIVES, body(b"<robot/>"))
        assert status == HTTPStatus.CONFLICT
        assert Path("robots/arm.urdf").read_bytes() == data
        chosen = {"operator": ["remote"], "robot": ["robots/arm.urdf"], "tip": ["tool0"]}
        assert start.answer("/begin", chosen, DRIVES)[0] == HTTPStatus.OK
        wait_until(lambda: wishes, "it is begun", 60)


SECRET = "hunter2"


def evaluated(folder: Path) -> tuple[Path, Path]:
    """A xacro outside of the console's folders whose error quotes a file, and that file."""
    keys, xacro = folder / "keys.yaml", folder / "arm.xacro"
    keys.write_text(f"{SECRET}: 1\n")
    names = f"${{list(xacro.load_yaml('{keys}'))[0]}}"
    xacro.write_text(f'<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><link name="{names}"/></robot>')
    return xacro, keys


@pytest.mark.parametrize("page", [DRIVES, WATCHES, STRANGER])
@pytest.mark.parametrize("field", ["robot", "followed", "tip"])
def test_form_reads_no_file_outside_of_its_folders_before_start(
    tmp_path: Path, field: str, page: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    xacro, keys = evaluated(tmp_path)
    asked = {"robot": [str(xacro)]} if field == "robot" else {"operator": ["file"], "followed": [str(keys)]}
    if field == "tip":  # a list of settings could name a file of drives
        asked = {"robot": [str(xacro)], "tip": [f"tool0,drives={keys}"]}
    read, watches = list[str](), [True]

    def watch(event: str, given: tuple[object, ...]) -> None:  # such a hook stays until the process ends
        if watches and event in {"open", "subprocess.Popen"}:
            read.append(str(given[:2]))

    sys.addaudithook(watch)
    with opened(tmp_path / "bags") as (start, _):
        _, told = start.answer("/start", asked, page)
        if page != DRIVES:
            assert "'chosen': {'operator': 'remote'}" in str(told)
            assert start.answer("/begin", asked, page)[0] == HTTPStatus.CONFLICT
    watches.clear()
    assert SECRET not in str(told)
    assert not [one for one in read if "arm.xacro" in one or "keys.yaml" in one]


def test_only_the_terminal_tells_what_a_file_of_another_folder_contains(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    xacro, _ = evaluated(tmp_path)
    with opened(tmp_path) as (start, wishes):
        status, told = start.answer("/begin", {"operator": ["remote"], "robot": [str(xacro)]}, DRIVES)
    assert status == HTTPStatus.CONFLICT
    assert "the terminal of the console says why" in str(told)
    assert str(xacro) in str(told)
    assert "joint" in capsys.readouterr().out
    assert wishes == [Wish({"operator": "remote"})]


def test_symbolic_links_are_followed_neither_by_uploads_nor_in_recordings(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    elsewhere, bags = tmp_path / "elsewhere", tmp_path / "bags"
    shutil.copytree(EXAMPLE, elsewhere / "run")
    bags.mkdir()
    (bags / "linked").symlink_to(elsewhere / "run")
    shutil.copytree(EXAMPLE, bags / "inside")
    data = next((bags / "inside").glob("*.mcap"))
    data.unlink()
    data.symlink_to(next((elsewhere / "run").glob("*.mcap")))
    shutil.copytree(EXAMPLE, bags / "plain")
    (bags / "plain.csv").symlink_to(elsewhere / "new.csv")
    recordings = Recordings(bags)
    assert [entry.name for entry in recordings.entries()] == ["plain"]
    with pytest.raises(ParameterError, match="symbolic link"):
        recordings.words("export", ["plain"])
    Path("robots").mkdir()
    Path("robots/arm.urdf").symlink_to(elsewhere / "arm.urdf")
    with opened(bags) as (start, _):
        sent = ("/robot", {"name": ["arm.urdf"]}, DRIVES, body(b"<robot/>"))
        assert start.answer(*sent)[0] == HTTPStatus.CONFLICT
        shutil.rmtree("robots")
        Path("robots").symlink_to(elsewhere)
        assert start.answer(*sent)[0] == HTTPStatus.CONFLICT
    assert not (elsewhere / "arm.urdf").exists()


@pytest.mark.parametrize("name", ["", "../arm.urdf", "/tmp/arm.urdf", ".urdf", "arm.py", "a/b.urdf"])
def test_robot_goes_nowhere_but_into_its_folder_and_comes_from_the_driver_alone(
    tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)

    def unread(most: int) -> bytes:
        raise AssertionError(most)

    with opened(tmp_path) as (start, _):
        for page, told in ((DRIVES, name), (WATCHES, "arm.urdf"), (STRANGER, "arm.urdf")):
            status, _ = start.answer("/robot", {"name": [told]}, page, unread)
            assert status == HTTPStatus.CONFLICT
        with pytest.raises(ValueError):
            start.answer("/robot", {"name": ["arm.urdf"]}, DRIVES, body(bytes(4 * 1024 * 1024 + 1)))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["..", "../run_1", "/etc", "", "run_2", "run_1/../run_1"])
def test_only_recordings_of_the_folder_are_shown_or_handed_to_commands(tmp_path: Path, name: str) -> None:
    shutil.copytree(EXAMPLE, tmp_path / "bags" / "run_1")
    recordings = Recordings(tmp_path / "bags")
    assert recordings.path("run_1") == tmp_path / "bags" / "run_1"
    for ask in (recordings.path, lambda name: recordings.words("score", [name])):
        with pytest.raises(ParameterError):
            ask(name)
    with pytest.raises(ParameterError):
        recordings.words("sim", ["run_1"])


def test_several_recordings_are_compared_and_one_is_exported_beside_itself(tmp_path: Path) -> None:
    for name in ("a", "b"):
        shutil.copytree(EXAMPLE, tmp_path / name)
    recordings, (a, b) = Recordings(tmp_path), (str(tmp_path / "a"), str(tmp_path / "b"))
    assert recordings.words("score", ["a", "b"]) == ["evaluate", a, b, "--differences"]
    assert recordings.words("export", ["a"]) == ["export", a, "--out", f"{a}.csv"]


@pytest.mark.slow
def test_verdict_of_a_recording_is_the_one_that_evaluate_gives(tmp_path: Path) -> None:
    import teleop_core as tc

    shutil.copytree(EXAMPLE, tmp_path / "run_1")
    (tmp_path / "broken").mkdir()
    (tmp_path / "broken" / "metadata.yaml").write_text("no recording")
    recordings = Recordings(tmp_path)

    def is_judged() -> bool:
        recordings.judge()
        return all(entry.is_good is not None for entry in recordings.entries())

    wait_until(is_judged, "both are judged", 120)
    by_name = {entry.name: entry for entry in recordings.entries()}
    score = tc.open_recording(EXAMPLE).score()
    assert by_name["run_1"].verdict == score.verdict.text
    assert by_name["run_1"].is_good == score.verdict.is_good
    assert "operator random" in by_name["run_1"].about
    assert by_name["broken"].is_good is False
    assert by_name["broken"].verdict.startswith("could not be scored: ")
    assert "is no recording" in by_name["broken"].verdict  # the reason of the command
