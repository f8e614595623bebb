"""Nodes: run the graph over ROS 2 topics, one thin node per stage."""
