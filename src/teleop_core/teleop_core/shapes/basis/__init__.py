"""Basis: what shapes are computed and drawn with."""
