"""Benchmarks of the engine gmrf."""
