"""Kinds of injections that only drives on EtherNet/IP can have, one in each file; as :mod:`pnfarm.faults.kinds`."""
