"""Kinds of injections for any drive and any link, one in each file; :mod:`pnfarm.faults.catalogue` finds them.

A file declares the kind (``KIND``) and its effect: an :class:`~pnfarm.faults.effects.effect.Effect` of its own or
another kind's.
"""
