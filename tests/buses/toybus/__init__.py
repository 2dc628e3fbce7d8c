"""A made-up bus in a folder of its own: what a bus has to bring, as small as it can be.

A controller sends :class:`~toybus.frames.Order`, the drive answers each with a :class:`~toybus.frames.Report`.  Nothing
else is said; whoever is silent for a tenth of a second is gone.
"""
