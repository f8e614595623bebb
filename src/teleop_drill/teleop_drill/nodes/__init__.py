"""Nodes: drills and tests of running nodes; only this part of the package needs ROS."""
