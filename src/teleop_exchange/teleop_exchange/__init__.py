"""Exchange: imports recordings of other programs, and exports recordings of this package.

- :func:`import_recording`: CSV, TSV, Parquet, rosbag2 and ROS 1 bags become a recording of this package;
- :func:`import_episodes`: each recording in a table or a LeRobot data set becomes one recording;
- :func:`export_recording`: recordings become CSV, Parquet or a LeRobot data set.
"""

import lazy_loader

__version__ = "0.6.0"

# pandas, pyarrow and rosbags are imported only where they are needed; the stub maps names to modules.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
