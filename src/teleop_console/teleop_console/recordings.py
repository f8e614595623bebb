"""Recordings: the recordings of a folder, the newest first; verdicts are added as soon as they are computed."""

import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

from teleop_console.folders import is_plain
from teleop_core.base.errors import ParameterError, TeleopError

_MOST = 50
"""Largest number of listed recordings."""
_FILE = "metadata.yaml"
_TOLD = "told.txt"  # file for what the command says while it scores
_COLUMNS = 132  # width of a command's output in characters
_KIND = {"score": "evaluate", "export": "export"}


@dataclass(frozen=True)
class Entry:
    """A recording in the list.

    Attributes:
        name: Name of the recording in the folder.
        made: Time at which the recording was closed [s since 1970].
        about: Line with scenario, robot and duration; empty while they are unknown.
        verdict: Line that names the worst score first; empty while it is unknown.
        is_good: Whether all scores are within their bounds; None while this is unknown.
    """

    name: str
    made: float
    about: str = ""
    verdict: str = ""
    is_good: bool | None = None


class Recordings:
    """Recordings of a folder.

    Args:
        folder: Folder of the recordings.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._known: dict[tuple[str, float], Entry] = {}
        self._judging: tuple[Entry, subprocess.Popen[bytes], Path] | None = None

    def entries(self) -> list[Entry]:
        """The newest recordings with the data that are known so far; the newest recording is first.

        A recording with a symbolic link is left out, because the link may lead to any file of this user.
        """
        found = []
        for file in self._folder.glob(f"*/{_FILE}"):
            name, made = file.parent.name, file.lstat().st_mtime
            found.append(self._known.get((name, made), Entry(name, made)))
        newest = sorted(found, key=lambda entry: -entry.made)
        return list(islice((entry for entry in newest if is_plain(self._folder / entry.name)), _MOST))

    def path(self, name: str) -> Path:
        """Path of a recording.

        Raises:
            ParameterError: The folder contains no recording with this name.
        """
        if name not in {entry.name for entry in self.entries()}:
            raise ParameterError("recording", name, f"the name of a recording in {self._folder}")
        return self._folder / name

    def words(self, kind: str, names: Sequence[str]) -> list[str]:
        """Arguments of a ``teleop`` command that scores, compares or exports recordings.

        Args:
            kind: ``score`` or ``export``.
            names: Names of the recordings, at least one; several recordings are compared.

        Raises:
            ParameterError: No recording has a given name, or the kind is unknown.
        """
        if kind not in _KIND or not names:
            raise ParameterError("action", kind, f"one of {', '.join(_KIND)}, for a recording that is named")
        paths = [str(self.path(name)) for name in names]
        out = ["--out", f"{paths[0]}.csv"] if kind == "export" else []
        if out and Path(out[1]).is_symlink():
            raise ParameterError("export", out[1], "no symbolic link: remove it, or export with `teleop export`")
        more = ["--differences"] if kind == "score" and len(paths) > 1 else out
        return [_KIND[kind], *(paths[:1] if kind == "export" else paths), *more]

    def run(self, kind: str, names: Sequence[str]) -> str:
        """Run the command of :meth:`words` at low priority, and return its output."""
        wide = os.environ | {"COLUMNS": str(_COLUMNS)}  # the request names several recordings
        words = [*_program(), *self.words(kind, names)]
        done = subprocess.run(words, capture_output=True, text=True, check=False, env=wide)
        return done.stdout or done.stderr

    def judge(self) -> None:
        """Begin or continue to compute the verdict of the newest recording without a verdict; never waits."""
        if self._judging is not None:
            self._take()
            return
        waiting = next((entry for entry in self.entries() if entry.is_good is None), None)
        if waiting is None:
            return
        out = Path(tempfile.mkdtemp(prefix="teleop_console_"), "score.json")
        words = [*_program(), "evaluate", str(self._folder / waiting.name), "--json", str(out)]
        with (out.parent / _TOLD).open("w") as told:  # a pipe that nobody empties would stop the process
            self._judging = waiting, subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=told), out

    def rest(self) -> None:
        """Cancel the verdict that is being computed, because a session needs the processors now."""
        if self._judging is not None:
            _, process, out = self._judging
            self._judging = None
            process.kill()
            process.wait()
            shutil.rmtree(out.parent)

    def _take(self) -> None:
        assert self._judging is not None
        entry, process, out = self._judging
        if process.poll() is None:
            return
        self._judging = None
        reason = (out.parent / _TOLD).read_text(encoding="utf-8", errors="replace").strip().rpartition("\n")[2]
        self._known[entry.name, entry.made] = _judged(self._folder, entry, out, reason)
        shutil.rmtree(out.parent)


def _program() -> list[str]:
    return ["nice", "-n", "15", sys.executable, "-m", "teleop_core.commands.cli"]


def _operator(path: Path) -> list[str]:
    """Kind of the first arm's operator; empty if the recording does not contain it."""
    from teleop_console.recorded_arms import configuration_of  # this import would slow commands that do not need it
    from teleop_core.bags.reader import Bag

    with suppress(TeleopError):
        configuration = configuration_of(Bag(path))
        return [] if configuration is None else [str(configuration.groups["operator"].kind.kind)]
    return []


def _judged(folder: Path, entry: Entry, out: Path, reason: str) -> Entry:
    """Entry with the verdict of the recording's score, or with the reason why the recording could not be scored."""
    if not out.is_file():
        why = reason.removeprefix("teleop evaluate: ").removeprefix(f"{folder / entry.name}: ")
        return Entry(entry.name, entry.made, "", f"could not be scored: {why or 'teleop evaluate'}", False)
    score = json.loads(out.read_text(encoding="utf-8"))[0]
    session, verdict = score["session"], score["verdict"]
    told = [str(session[key]) for key in ("scenario", "robot") if session.get(key)]
    told += [f"operator {kind}" for kind in _operator(folder / entry.name)]
    if (task := score["task"])["attempts"]:
        took = f", {task['time_s']:.1f} s each" if task["successes"] and task["time_s"] is not None else ""
        told.append(f"{task['successes']:g} of {task['attempts']:g} attempts reached their goal{took}")
    return Entry(entry.name, entry.made, " · ".join(told), verdict["text"], verdict["worst"] is None)
