"""Benchmarks of the cyclic frames of a farm and its controller."""
