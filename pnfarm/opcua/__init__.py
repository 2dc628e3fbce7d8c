"""The farm over OPC UA (IEC 62541): drives, devices and the plant as nodes.  Needs the extra `opcua` (asyncua).

asyncua runs in a thread and an event loop of its own, so that no client holds up the farm's; what it wants of the farm
is carried to the farm's loop (:mod:`pnfarm.opcua.carrier`), which gives it a bounded part of its time.
"""

from pnfarm.opcua.serving import prepare_opcua, serve_opcua

__all__ = ["prepare_opcua", "serve_opcua"]
