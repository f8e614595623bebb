from .exporting import ExportReport as ExportReport, export_recording as export_recording
from .every_episode import EpisodesReport as EpisodesReport, import_episodes as import_episodes
from .importing import import_recording as import_recording
from .options import ImportOptions as ImportOptions
from .import_report import ImportReport as ImportReport

__version__: str
