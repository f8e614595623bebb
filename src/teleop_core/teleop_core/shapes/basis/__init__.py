"""Basis: functions to compute and draw shapes."""
