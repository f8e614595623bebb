"""Slave: the arm's server, its operation, and its simulated drives: control laws and plants."""
