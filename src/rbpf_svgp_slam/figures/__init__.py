"""Figures of a finished run, of several, and of experiments. Needs no ROS."""
