"""The farm over HTTP: drives, parameters, faults, events, metrics, and a web page."""

from pnfarm.api.app import make_app
from pnfarm.api.server import serve, serve_farm

__all__ = ["make_app", "serve", "serve_farm"]
