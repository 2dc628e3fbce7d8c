"""What the built-in controllers of all buses have in common."""
