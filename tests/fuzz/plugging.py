"""What a device is made of when a description file was read: its modules, records, diagnoses and signals."""

from __future__ import annotations

from contextlib import suppress

from pnfarm.buses.profinet.file_signals import file_signals
from pnfarm.protocols.profinet.gsdml.diagnosis import DiagnosisCatalogue
from pnfarm.protocols.profinet.gsdml.reader import parse_gsdml
from pnfarm.protocols.profinet.gsdml.station import PlugError, plug_station

__all__ = ["plug_everything"]

#: Choices for each access point.
MOST = 4


def plug_everything(data: bytes) -> None:
    """Raises :class:`DecodeError` where the octets are no description; what cannot be plugged is no error."""
    gsdml = parse_gsdml(data)
    catalogue = DiagnosisCatalogue(gsdml)
    for error in catalogue.described:
        catalogue.texts(error, "de")
    for dap in gsdml.daps:
        choices: list[dict[int, str]] = [{}]
        for ref in dap.modules[:MOST]:
            choices += [
                {place: ref.target} for places in (ref.allowed, ref.used, ref.fixed) for place, _ in places.ranges[:1]
            ]
        for modules in choices:
            with suppress(PlugError):
                station = plug_station(gsdml, access_point=dap.id, modules=modules)
                names = [signal.name for signal in file_signals(station)]
                assert len(set(names)) == len(names)
                for submodule in station.submodules:
                    for record in submodule.records:
                        record.complaint(record.defaults())
