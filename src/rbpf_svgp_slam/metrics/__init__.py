"""Metrics of a finished run. Needs no ROS."""
