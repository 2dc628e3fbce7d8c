"""Kinds of injections for any drive and any link, one in each file; :mod:`pnfarm.faults.catalogue` finds them.

A file declares what a user writes and reads (``KINDS``), and carries it out: an :class:`~pnfarm.faults.effect.Effect`
of its own or one of another kind's.
"""
