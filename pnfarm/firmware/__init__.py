"""What a servo does each tick: plain functions over one record, compiled by the engine, debuggable without.

A function takes the subjects of the axis record (``pnfarm.firmware.axis``) that it works on, or the whole record where
they are many, and integer ``now``.  A front translates between the controller and the axis: ``profidrive`` turns the
words of its telegrams into orders of the axis, and the axis' state into words; no other module reads or writes them.
"""
