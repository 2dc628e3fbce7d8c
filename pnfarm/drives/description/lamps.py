"""The lamps of a drive's network interface: how each of them is lit in each state."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Lamps"]


@dataclass(frozen=True, slots=True)
class Lamps:
    """``names``, and for each state one text per lamp, such as ``on``, ``off`` or how it flashes.

    ``boot``: the drive starts; ``ready``: no cyclic data; ``exchange``: cyclic data of RT class 1; ``signal``: a
    tool makes the drive flash (DCP Signal).
    """

    names: tuple[str, ...]
    boot: tuple[str, ...]
    ready: tuple[str, ...]
    exchange: tuple[str, ...]
    signal: tuple[str, ...]

    def show(self, *, powered: bool, booting: bool, exchanging: bool, signalling: bool) -> dict[str, str]:
        """The lamps by name; without supply all are off."""
        if not powered:
            return dict.fromkeys(self.names, "off")
        lit = self.signal if signalling else self.exchange if exchanging else self.boot if booting else self.ready
        return dict(zip(self.names, lit, strict=True))
