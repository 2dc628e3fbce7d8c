"""Sections of the farm file, as types: the keys of any drive and any controller; a bus adds its own keys."""
