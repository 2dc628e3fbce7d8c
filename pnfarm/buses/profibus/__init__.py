"""PROFIBUS DP: drives as slaves on one serial line, and their master."""
