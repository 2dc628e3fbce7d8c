"""``pnfarm verify``: known faults on a known farm on this machine, compared with what is expected, and its limits.

Farm files and expectations are in ``known/``, the report is :mod:`.report`.
"""
