"""Slave: the simulated arm, its joints and drives, and references without jumps."""
