"""Captures in words, whatever the bus: what is in a capture file, who is who in it, and what two stations did.

:mod:`reading` a file's frames; :mod:`stations` who is who; :mod:`packet` a frame and its description; :mod:`neutral`
frames of no bus (ARP, ICMP, other IP); :mod:`decoder` gives each frame to the bus that knows it;
:mod:`conversations` the summary.
"""
