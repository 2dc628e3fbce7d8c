"""The master of the drives of a farm file."""
