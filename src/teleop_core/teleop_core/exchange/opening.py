"""Opening: which kind of file something is, and the source that reads it."""

from pathlib import Path
from typing import TYPE_CHECKING

from teleop_core.damage import damage_told
from teleop_core.errors import RecordingError
from teleop_core.exchange.options import ImportOptions
from teleop_core.exchange.source import Source

if TYPE_CHECKING:
    from teleop_core.exchange.tables import Table

_BAGS = {".bag", ".mcap", ".db3"}


def is_bag(path: Path) -> bool:
    """Whether a path is a recording of ROS: a directory of one, or a file of one."""
    return path.is_dir() or path.suffix.lower() in _BAGS


def open_source(path: Path, options: ImportOptions) -> Source:
    """Source that reads a file.

    Raises:
        RecordingError: It is missing, empty, or nothing that can be read.
        ParameterError: An option does not fit it.
    """
    if not path.exists():
        raise RecordingError(path, "does not exist")
    if is_bag(path):
        from teleop_core.exchange.bag_source import BagSource

        return BagSource(path, options)
    from teleop_core.exchange.table_source import TableSource

    return TableSource(_table(path, options), options)


def _table(path: Path, options: ImportOptions) -> "Table":
    from teleop_core.exchange.tables import ParquetTable
    from teleop_core.exchange.text_table import TextTable

    with damage_told(path), path.open("rb") as file:
        magic = file.read(4)
    return ParquetTable(path) if magic == b"PAR1" else TextTable(path, options.skip)
