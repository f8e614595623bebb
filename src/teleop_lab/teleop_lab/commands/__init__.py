"""Commands that this package adds to ``teleop``, through the entry-point group of teleop_core."""
