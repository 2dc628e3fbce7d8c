"""Faults that only drives on PROFIBUS can have, and what the others are there."""
