"""One exception tree.  Who is to blame is the type.

========================  ==========================================================  =========
type                      blame                                                       exit code
========================  ==========================================================  =========
:class:`ConfigError`      what the user wrote: a file, a flag, an API body            2
:class:`DecodeError`      the bytes that a peer sent                                  -
:class:`RemoteError`      a peer that answered with an error or did not answer        1
:class:`EnvironmentError_`  the machine: privilege, interface, kernel module, tool      4
:class:`InternalError`    this program                                                5
========================  ==========================================================  =========

Every message is one sentence: what, where, what would be right.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable

__all__ = [
    "ConfigError",
    "DecodeError",
    "EnvironmentError_",
    "FieldsError",
    "InternalError",
    "PnfarmError",
    "RemoteError",
]


class PnfarmError(Exception):
    """Root of everything this package raises on purpose."""

    exit_code = 5


class ConfigError(PnfarmError):
    """The user's input is wrong."""

    exit_code = 2


class FieldsError(ConfigError):
    """A request with wrong fields: ``issues`` are (field, what is wrong, what is allowed)."""

    #: Before each field, and between the sentences of the message.
    before, between = "", "; "

    def __init__(self, issues: Iterable[tuple[str, str, str]]) -> None:
        self.issues = tuple(issues)
        sentences = (
            f"{self.before}{field}: {what}" + (f"; allowed: {allowed}" if allowed else "")
            for field, what, allowed in self.issues
        )
        super().__init__(self.between.join(sentences))


class DecodeError(PnfarmError):
    """Received bytes do not follow their format.

    ``reason`` is a short slug, stable enough to be a metric's label (``short``, ``bad-length``,
    ``bad-type`` ...); ``detail`` is the text for people.
    """

    exit_code = 5

    def __init__(self, reason: str, detail: str = "") -> None:
        super().__init__(f"{reason}: {detail}" if detail else reason)
        self.reason = reason
        self.detail = detail


class RemoteError(PnfarmError):
    """A peer refused or stayed silent."""

    exit_code = 1


class EnvironmentError_(PnfarmError):  # noqa: N801, N818 - the name is part of the design; the builtin keeps its own
    """This machine cannot: privilege, interface, kernel module or tool missing."""

    exit_code = 4


class InternalError(PnfarmError):
    """A promise of this program's own does not hold."""

    exit_code = 5
