"""Bodies: the solids of every robot, made from its kinematics, and their poses.

``bodies_of(robot)`` returns the links of any robot as capsules, cylinders and spheres, each in the frame of a body;
``bodies_of(robot).poses(q)`` returns their poses. The first body is the base, the last is the tip. ``urdf_of(robot)``
returns the bodies as a URDF.
"""

from teleop_core.robots.bodies.describe import bodies_of
from teleop_core.robots.bodies.urdf import urdf_of
from teleop_core.robots.body import Bodies, Body, Joint
from teleop_core.robots.solids import Kind, Role, Solid

__all__ = ["Bodies", "Body", "Joint", "Kind", "Role", "Solid", "bodies_of", "urdf_of"]
