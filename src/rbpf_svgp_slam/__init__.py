"""Bathymetric SLAM: a Rao-Blackwellized particle filter over Gaussian-process maps."""
