"""Bodies: the solids of every robot, made from its kinematics, and where they are.

``bodies_of(robot)`` gives the links of any robot as capsules, cylinders and spheres, each in the
frame of a body; ``bodies_of(robot).poses(q)`` says where the bodies are. The last body is the tip.
"""

from teleop_core.bodies.body import Bodies, Body, Joint
from teleop_core.bodies.describe import bodies_of
from teleop_core.bodies.solids import Kind, Role, Solid

__all__ = ["Bodies", "Body", "Joint", "Kind", "Role", "Solid", "bodies_of"]
