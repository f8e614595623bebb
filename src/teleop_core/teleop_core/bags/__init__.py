"""Bags: recordings as rosbag2 directories of MCAP files, written as columns and read as arrays."""
