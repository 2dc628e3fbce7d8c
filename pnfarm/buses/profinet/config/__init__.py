"""PROFINET's part of the farm file: its keys, what they must hold, and what they make of a drive."""
