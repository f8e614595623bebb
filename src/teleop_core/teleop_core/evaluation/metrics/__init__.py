"""Metrics: what is measured on every recording, a file for each, or for those of one kind.

A further metric is one more such file and one line in :mod:`teleop_core.evaluation.registry`, or,
outside of this package, a class that is added to its ``METRICS``.
"""
