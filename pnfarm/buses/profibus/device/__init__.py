"""A drive as a DP slave."""
