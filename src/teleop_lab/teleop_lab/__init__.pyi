from . import calibration as calibration, experiments as experiments
from .experiments import (
    Bench as Bench,
    Experiment as Experiment,
    Findings as Findings,
    Outcome as Outcome,
    Comparison as Comparison,
    register_experiment as register_experiment,
)
from .fitting import FitError as FitError, FitResult as FitResult, fit_plant as fit_plant
from .grading import grade as grade
from .planning.reach import reach as reach
from .planning.reach_result import Reach as Reach
from .studies import (
    Study as Study,
    Tuning as Tuning,
    read_study as read_study,
    read_tuning as read_tuning,
    sweep as sweep,
)

__version__: str
