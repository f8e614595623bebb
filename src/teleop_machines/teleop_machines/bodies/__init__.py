"""Bodies of robots with loops, as they are drawn; each robot names its own as ``describe``."""
