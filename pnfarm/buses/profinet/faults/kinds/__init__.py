"""Kinds of injections that only PROFINET drives can have, one in each file; as :mod:`pnfarm.faults.kinds`."""
