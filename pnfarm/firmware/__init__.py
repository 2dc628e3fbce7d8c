"""What a servo does each tick: plain functions over one record, compiled by the engine, debuggable without.

Every function takes the axis record (``pnfarm.firmware.axis``), some the image record too, and integer ``now``.
"""
