"""Benchmarks of the smoother."""
