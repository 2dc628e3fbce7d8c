"""The demo's faults: one of each family."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

__all__ = ["FAULTS", "DemoFault"]


@dataclass(frozen=True, slots=True)
class DemoFault:
    """``place``: the drive that gets it, or the first one after it that can.

    ``disconnects``: it ends the connection.  ``reads``: the controller reads the drive's parameter record meanwhile.
    """

    family: str
    fields: Mapping[str, Any]
    place: int
    disconnects: bool = False
    reads: bool = False

    @property
    def kind(self) -> str:
        return str(self.fields["kind"])

    def turn(self, names: Sequence[str]) -> Sequence[str]:
        """The drives in the order in which they are tried."""
        place = min(self.place, len(names) - 1)
        return [*names[place:], *names[:place]]


FAULTS = (
    DemoFault("drive", {"kind": "f702"}, 2),
    DemoFault("link", {"kind": "timeout"}, 4, disconnects=True),
    DemoFault("frames", {"kind": "loss", "probability": 0.3, "for": "500ms"}, 0),
    DemoFault("cyclic", {"kind": "iops-bad", "for": "500ms"}, 3),
    DemoFault("liveness", {"kind": "sign-of-life-freeze", "for": "500ms"}, 4),
    DemoFault("connection", {"kind": "ar-abort"}, 5, disconnects=True),
    DemoFault("records", {"kind": "record-error", "count": 1}, 1, reads=True),
    DemoFault("alarms", {"kind": "diagnosis", "for": "500ms"}, 0),
)
