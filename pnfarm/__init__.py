"""A farm of virtual servo drives that a real controller runs."""

__version__ = "0.1.0"
