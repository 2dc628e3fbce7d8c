"""PROFIBUS's part of the farm file."""
