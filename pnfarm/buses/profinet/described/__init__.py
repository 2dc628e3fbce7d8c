"""Devices that their makers' GSDML files describe, as stations of a farm."""
