"""The demo's faults: one of each family of kinds for drives."""

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
    DemoFault({"kind": "f702"}, 2),
    DemoFault({"kind": "timeout"}, 4, disconnects=True),
    DemoFault({"kind": "loss", "probability": 0.3, "for": "500ms"}, 0),
    DemoFault({"kind": "iops-bad", "for": "500ms"}, 3),
    DemoFault({"kind": "sign-of-life-freeze", "for": "500ms"}, 4),
    DemoFault({"kind": "ar-abort"}, 5, disconnects=True),
    DemoFault({"kind": "record-error", "count": 1}, 1, reads=True),
    DemoFault({"kind": "diagnosis", "for": "500ms"}, 0),
)
