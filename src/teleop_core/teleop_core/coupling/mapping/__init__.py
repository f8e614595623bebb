"""Mapping: from the master's motion to the slave's: scaling, clutch, walls, filters."""
