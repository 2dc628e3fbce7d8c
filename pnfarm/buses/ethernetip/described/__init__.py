"""Devices that their makers' EDS files describe, as stations of a farm."""
