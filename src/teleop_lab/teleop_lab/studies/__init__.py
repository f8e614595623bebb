"""Studies: sessions over named values of parameters and seeds; an interrupted study can be continued.

>>> from teleop_lab import sweep
>>> found = sweep("point", metrics=["task.time_s"], seed=range(5),
...               settings={"display.latency": [0.033, 0.133, 0.333]})
>>> found["task.time_s"].mean("seed")
"""

from teleop_lab.studies.dataset import dataset_of
from teleop_lab.studies.study import Explained, Study, read_study, sweep
from teleop_lab.studies.tuning import SearchRange, Trial, Tuned, Tuning, read_tuning

__all__ = [
    "Explained", "SearchRange", "Study", "Trial", "Tuned", "Tuning", "dataset_of", "read_study",
    "read_tuning", "sweep",
]  # fmt: skip
