"""Files of robots: URDF and xacro, how they look, and where the user has fetched them."""
