"""Stochastic variational Gaussian process (SVGP) maps; free of ROS."""
