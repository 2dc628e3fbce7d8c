"""Captures as text, whatever the bus: the contents of a capture file, its stations, and their conversations.

:mod:`reading` a file's frames; :mod:`stations` who is who; :mod:`packet` a frame and its description; :mod:`neutral`
frames of no bus (ARP, ICMP, other IP); :mod:`decoder` gives each frame to the bus that knows it;
:mod:`conversations` the summary.
"""
