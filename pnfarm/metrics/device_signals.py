"""Signals of devices and of models of the plant that the farm file exports (``metrics: true``), and no others."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.metrics.families import Family, Values

if TYPE_CHECKING:
    from pnfarm.farm.core import FarmCore

__all__ = ["SignalFamily"]


class SignalFamily:
    """One series for each exported signal, with the labels ``station`` and ``signal``."""

    def __init__(self, core: FarmCore) -> None:
        self._family = Family(
            "pnfarm_signal_value",
            "gauge",
            "Value of a signal of a device or a model that the farm file exports, in its unit; a bit is 0 or 1.",
            ("station", "signal"),
        )
        self._devices = []
        for station, device in core.signal_owners.items():
            signals = device.signals
            names = [name for name in signals.names if signals.signal(name).exported] if signals is not None else []
            for name in names:
                self._family.add(station, name)
            if names and signals is not None:
                self._devices.append(signals)

    def gather(self) -> list[tuple[Family, Values]]:
        """Read them; in the thread of the stations."""
        values = [
            float(value)
            for signals in self._devices
            for signal, value, _ in signals.readings()
            # numbers and bits alone can be exported
            if signal.exported
        ]
        return [(self._family, values)] if values else []
