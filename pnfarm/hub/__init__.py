"""One API for the farms of many machines: finds them, asks all at once, puts their answers together."""

from pnfarm.hub.app import make_hub_app
from pnfarm.hub.hub import Hub

__all__ = ["Hub", "make_hub_app"]
