"""A run folder as files for charts, GIS and navigation processing. Needs no ROS."""
