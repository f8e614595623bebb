"""Exchange: recordings of others come in, ours go out.

- :func:`import_recording`: CSV, TSV, Parquet, rosbag2 and ROS 1 bags become a recording of ours;
- :func:`import_episodes`: all recordings of a table or a LeRobot data set become one each;
- :func:`export_recording`: recordings become CSV, Parquet or a LeRobot data set.
"""

import lazy_loader

__version__ = "0.6.0"

# pandas, pyarrow and rosbags are loaded where they are needed; the stub says what is where.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
