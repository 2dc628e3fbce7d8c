"""Benchmarks of a farm in memory, in virtual time."""
