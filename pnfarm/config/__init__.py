"""Sections of the farm file, as types: what any drive and any controller can have; a bus adds its own keys."""
