"""The fieldbuses, each in its own package."""
