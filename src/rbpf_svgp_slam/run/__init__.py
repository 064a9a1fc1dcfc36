"""A finished run: what it consists of, and the files of its folder. Needs no ROS."""
