"""Jaw of the slave: a server that commands its angle, a simulated drive, and the object that the jaw grips."""
