"""Nodes: the graph over ROS 2 topics, one thin node per stage; the only place that imports ROS."""
