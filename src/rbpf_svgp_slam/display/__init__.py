"""How a survey goes, as an image for RViz."""
