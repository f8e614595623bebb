"""Exchange: recordings of others come in, ours go out.

- :func:`import_recording`: CSV, TSV, Parquet, rosbag2 and ROS 1 bags become a recording of ours;
- :func:`export_recording`: recordings become CSV, Parquet or a LeRobot data set;
- :func:`as_master_bag`: any recording as one whose master can be replayed.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from teleop_core.exchange.exporting import ExportReport, export_recording
    from teleop_core.exchange.importing import import_recording
    from teleop_core.exchange.master_bag import as_master_bag
    from teleop_core.exchange.options import ImportOptions
    from teleop_core.exchange.report import ImportReport

_HOME = {
    "ExportReport": "exporting",
    "ImportOptions": "options",
    "ImportReport": "report",
    "as_master_bag": "master_bag",
    "export_recording": "exporting",
    "import_recording": "importing",
}

__all__ = [
    "ExportReport",
    "ImportOptions",
    "ImportReport",
    "as_master_bag",
    "export_recording",
    "import_recording",
]


def __getattr__(name: str) -> object:
    """Load a name on first use: pandas, pyarrow and rosbags are loaded where they are needed."""
    if name in _HOME:
        return getattr(import_module(f"teleop_core.exchange.{_HOME[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
