"""Errors about injections."""

from __future__ import annotations

from pnfarm.errors import FieldsError

__all__ = ["InjectionError"]


class InjectionError(FieldsError):
    """An injection that cannot be put in force; one line for each wrong field."""

    before, between = "fault.", "\n"
