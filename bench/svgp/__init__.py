"""The SVGP against GPyTorch's, alone and over ROS.

`gpytorch_map`, `golden` and `worker` also run in the virtual environments of GPyTorch: they import
nothing but numpy, torch and gpytorch there.
"""
