"""Chains of links: their kernels, their dynamics, and joints that follow other joints."""
