"""Kinds of injections that only drives on PROFIBUS can have, one in each file; as :mod:`pnfarm.faults.kinds`."""
