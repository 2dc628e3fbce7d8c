"""The fieldbuses, each in a room of its own."""
