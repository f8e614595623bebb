"""Slave: the simulated arm, its joints and drives, and references that follow each other smoothly."""
