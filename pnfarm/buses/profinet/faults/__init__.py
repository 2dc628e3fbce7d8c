"""Injections into PROFINET drives: their kinds, and the parts of a drive that these need."""
