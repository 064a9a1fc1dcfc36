"""Benchmarks of the package; run by tools/bench.sh."""
