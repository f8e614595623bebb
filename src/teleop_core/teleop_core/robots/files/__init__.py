"""Files of robots: URDF and xacro, their meshes, and descriptions that the user has downloaded."""
