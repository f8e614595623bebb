"""Robots with loops: parallel machines, the hybrid of SCARA and Stewart platform, the MMA handle.

They are used like the robots of ``teleop_core``, which finds them by the entry-point group
``teleop_core.robots``: ``load_robot("stewart")``, ``teleop sim --set robot=stewart``.
"""

__version__ = "0.6.0"
