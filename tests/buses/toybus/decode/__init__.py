"""Frames of the toy bus in a capture."""
