"""Metrics: the quantities measured on every recording, one file for each metric or for metrics of one kind.

To add a metric, add a file here and one line in :mod:`teleop_core.evaluation.registry`. Outside of this package, add a
class to ``METRICS`` of that module.
"""
