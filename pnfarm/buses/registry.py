"""The buses that there are: the only list of them."""

from __future__ import annotations

from pnfarm.buses.profinet.device.view import CONNECTION_STATES, USUAL_LOSSES

__all__ = ["CONNECTION_STATES", "USUAL_LOSSES"]
