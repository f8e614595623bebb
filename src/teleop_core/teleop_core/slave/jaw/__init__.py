"""Jaw of the slave: a server that leads its angle; a simulated drive, and the object it grips."""
