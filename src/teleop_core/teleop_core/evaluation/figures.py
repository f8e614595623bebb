"""Figures: all plots of one recording."""

from teleop_core.evaluation.figure import Figure
from teleop_core.evaluation.metrics import Study
from teleop_core.evaluation.path_figures import path_in_planes, path_in_space
from teleop_core.evaluation.time_figures import (
    force,
    latency,
    orientation_error,
    position,
    position_error,
)


def figures(study: Study) -> list[Figure]:
    """Plots in the order of the page; those without data are left out."""
    boxes = study.drawing.boxes()
    found = (
        path_in_space(study, boxes),
        path_in_planes(study, boxes),
        position(study, boxes),
        position_error(study),
        orientation_error(study),
        force(study, boxes),
        latency(study),
    )
    return [figure for figure in found if figure is not None]
