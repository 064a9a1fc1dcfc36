"""Peers: other methods for the same problem, each as plain as its idea; rows of the study."""
