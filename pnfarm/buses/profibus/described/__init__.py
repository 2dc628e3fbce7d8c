"""Devices that their makers' GSD files describe, as stations of a farm."""
