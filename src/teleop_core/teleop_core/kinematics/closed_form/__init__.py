"""Closed forms: inverse kinematics of chains with special axes, and how these chains are recognised."""
