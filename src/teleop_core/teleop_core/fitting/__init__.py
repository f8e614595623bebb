"""Fitting: numbers of a plant from what was measured on the machine."""
