"""What a servo does each tick: plain functions over one record, compiled by the engine, debuggable without.

A function takes the subjects of the axis record (``pnfarm.firmware.axis``) that it works on, or the whole record where
they are many, and integer ``now``.  What the controller asks and sees is a front's: ``profidrive`` turns the words of
its telegrams into orders of the axis, and the axis' state into words; nothing beside it reads or writes one.
"""
