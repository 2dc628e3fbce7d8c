"""config-fault: the slave takes no configuration."""

from __future__ import annotations

from pnfarm.buses.profibus.faults.slave_effect import SlaveEffect
from pnfarm.faults.kind import HELD, InjectionKind

__all__ = ["KIND"]


class ConfigFault(SlaveEffect):
    """Confirmed by a Chk_Cfg that it refuses."""

    what = "configuration"

    def seen(self) -> int:
        return self.slave.refusals


KIND = InjectionKind(
    "config-fault",
    "connection",
    "The slave leaves its data exchange and refuses every configuration, as one with other modules.",
    "a configuration that is refused",
    ConfigFault,
    takes=HELD,
    place=75,
    wire="Chk_Cfg is acknowledged; the diagnosis after it has Cfg_Fault.",
    reports="S7: configuration error of the slave, station failure (OB86); CODESYS the same (assumed).",
)
