"""Traces in the files of other tools: ROS 2 bags and MCAP."""
