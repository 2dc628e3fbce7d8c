"""The built-in scanner."""
