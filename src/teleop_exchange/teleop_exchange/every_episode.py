"""Every episode: converts a table or data set to a folder with one recording for each episode."""

import shutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType

from teleop_core.bags.finding import METADATA
from teleop_core.base.errors import RecordingError, TeleopError
from teleop_core.session.recording import open_recording
from teleop_exchange import episodes, import_report, imported_motion, importing
from teleop_exchange.options import Changes, ImportOptions, Option, options_of


@dataclass(frozen=True)
class EpisodesReport:
    """Result of an import of all episodes.

    Attributes:
        out: Folder of the recordings.
        made: Report of each new recording, by the number of the episode.
        kept: Numbers of the episodes whose recording existed before the import.
        refused: Reason for each episode that could not be imported, by its number.
    """

    out: Path
    made: Mapping[int, import_report.ImportReport]
    kept: tuple[int, ...]
    refused: Mapping[int, str]

    def __str__(self) -> str:
        counts = f"{len(self.made)} episodes imported, {len(self.kept)} kept"
        return f"{self.out}: {counts}, {len(self.refused)} refused"


def import_episodes(
    file: Path | str,
    out: Path | str,
    options: ImportOptions | None = None,
    *,
    arms: Mapping[str, Changes] = MappingProxyType({}),
    say: Callable[[str], object] = lambda _: None,
    **changes: Option,
) -> EpisodesReport:
    """Make a recording of each episode of a table, or of a data set of LeRobot.

    Recordings that already exist in the folder are kept, so that an interrupted import can be continued. An episode
    that cannot be imported does not stop the import of the others.

    Args:
        file: Table with a column such as ``episode_index``, or folder of the data set.
        out: Folder of the recordings ``episode_000000`` and so on; may already exist.
        options: Options of :func:`teleop_exchange.import_recording`, without ``episode``.
        arms: As in :func:`teleop_exchange.import_recording`.
        say: Called with a line of text after each episode.
        **changes: Options by name.

    Raises:
        RecordingError: The file is missing or damaged, or contains an episode twice.
        ParameterError: No column contains the episode numbers, or an option is wrong.
    """
    base, out = options or ImportOptions(), Path(out)
    options_of(base, arms, changes)  # raises an error here, not once for each episode
    files = files_of(Path(file), base.changed(**changes))
    made: dict[int, import_report.ImportReport] = {}
    kept, refused = [], dict[int, str]()
    for count, (number, path) in enumerate(sorted(files.items()), start=1):
        target, of_one = out / f"episode_{number:06d}", replace(base, episode=number)
        where = f"{target.name} ({count} of {len(files)})"
        wanted = options_of(of_one, arms, changes)
        try:
            if _is_there(target, importing.command_of(path, target, wanted)):
                kept.append(number)
                say(f"{where}: kept")
                continue
            out.mkdir(parents=True, exist_ok=True)
            made[number] = importing.import_recording(path, target, of_one, arms=arms, **changes)
            say(f"{where}: {made[number].duration:.1f} s imported")
        except TeleopError as error:
            refused[number] = str(error)
            say(f"{where}: refused: {error}")
    return EpisodesReport(out, made, tuple(kept), refused)


def files_of(path: Path, options: ImportOptions) -> dict[int, Path]:
    """File of each episode, by its number.

    Args:
        path: A single file, or the folder of a data set with Parquet files in ``data``.
        options: Options for reading text files.

    Raises:
        RecordingError: The folder contains no data file, a file is damaged, or two files contain the same episode.
        ParameterError: A file contains no column of episode numbers.
    """
    files = _data_files(path / "data") if path.is_dir() else [path]
    if not files or not path.exists():
        reason = "holds no data/**/*.parquet" if path.exists() else "does not exist"
        raise RecordingError(path, reason)
    found: dict[int, Path] = {}
    for file in files:
        for number in episodes.numbers_of(imported_motion.open_table(file, options), options):
            if number in found:
                raise RecordingError(path, f"contains episode {number} twice, in {found[number]} and {file}")
            found[number] = file
    return found


def _data_files(folder: Path) -> list[Path]:
    """Parquet files below a folder, without those that a system hides there, such as ``._file-000.parquet``."""
    found = {file.relative_to(folder): file for file in folder.rglob("*.parquet")}
    return sorted(file for own, file in found.items() if not any(part.startswith(".") for part in own.parts))


def _is_there(target: Path, command: str) -> bool:
    """Whether the recording was already made by the same command; an incomplete recording is removed.

    Raises:
        RecordingError: The recording was made by another command.
    """
    if not target.exists():
        return False
    is_half = not (target / METADATA).exists()
    if is_half and all(file.suffix == ".mcap" for file in target.iterdir()):
        shutil.rmtree(target)
        return False
    before = open_recording(target).metadata.get("imported_by", "another command")
    if before != command:
        raise RecordingError(target, f"was made by {before}; choose another --out")
    return True
