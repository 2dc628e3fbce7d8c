"""The farm over HTTP: drives, parameters, faults, events, metrics, and a web page."""

from pnfarm.api.app import make_app
from pnfarm.api.server import api_url, audit_of, serve, serve_farm, tls_of

__all__ = ["api_url", "audit_of", "make_app", "serve", "serve_farm", "tls_of"]
