"""PROFINET's part of the farm file: its keys, their checks, and the drives made from them."""
