"""Coupling: what lies between master and slave: mapping, fixtures, filters, network, passivity, architectures."""
