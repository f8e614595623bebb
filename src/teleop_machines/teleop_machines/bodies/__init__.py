"""Bodies of robots with loops, for drawing. Each robot names its function of this folder as ``describe``."""
