"""Closed forms: inverse kinematics of chains whose axes lie well, and which chains these are."""
