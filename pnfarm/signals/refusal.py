"""Signals that cannot be read or written, with the reason of each."""

from __future__ import annotations

from pnfarm.errors import FieldsError

__all__ = ["SignalError"]


class SignalError(FieldsError):
    """The fields are signals."""
