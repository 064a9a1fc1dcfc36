"""The nodes: everything in rbpf_svgp_slam that imports rospy, and nothing else does."""
