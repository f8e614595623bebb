"""Nodes: drills and tests of running nodes, the only part here that needs ROS."""
