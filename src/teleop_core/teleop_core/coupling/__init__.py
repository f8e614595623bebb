"""Coupling: the stages between master and slave: mapping, fixtures, filters, network, passivity, architectures."""
