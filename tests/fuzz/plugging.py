"""What a device is made of when a description file was read: its modules, assemblies, records, diagnoses, signals."""

from __future__ import annotations

from contextlib import suppress

from pnfarm.buses.ethernetip.described.file_signals import assembly_signals
from pnfarm.buses.ethernetip.described.kind import offer_of
from pnfarm.buses.ethernetip.described.station import composed, points_of
from pnfarm.buses.profibus import maker_identity
from pnfarm.buses.profibus.device.product import Product
from pnfarm.buses.profinet.file_signals import file_signals
from pnfarm.buses.profinet.maker_identity import identity_of
from pnfarm.drives import catalogue
from pnfarm.drives.description.identity import with_identity
from pnfarm.errors import ConfigError
from pnfarm.protocols.enip.eds.reader import parse_sheet
from pnfarm.protocols.profibus.gsd import values as gsd_values
from pnfarm.protocols.profibus.gsd.reader import parse_gsd_file
from pnfarm.protocols.profibus.gsd.station import plug_slave
from pnfarm.protocols.profinet.gsdml.diagnosis import DiagnosisCatalogue
from pnfarm.protocols.profinet.gsdml.reader import parse_gsdml
from pnfarm.protocols.profinet.gsdml.station import PlugError, plug_station

__all__ = ["describe_everything", "plug_every_module", "plug_everything"]

#: Choices for each access point.
MOST = 4


def plug_everything(data: bytes) -> None:
    """Raises :class:`DecodeError` where the octets are no description; what cannot be plugged is no error."""
    gsdml = parse_gsdml(data)
    drive = catalogue.model("profidrive")
    with suppress(ConfigError):
        described = with_identity(drive, identity_of(gsdml, drive).overrides)
        for telegram in described.profidrive.telegrams.values():
            assert telegram.module.data.output_bytes == 2 * len(telegram.output)
    diagnoses = DiagnosisCatalogue(gsdml)
    for error in diagnoses.described:
        diagnoses.texts(error, "de")
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


def describe_everything(data: bytes) -> None:
    """Raises :class:`DecodeError` where the octets are no description: all that an EDS file lets a device offer."""
    sheet = parse_sheet(data)
    offered = [one for one in sheet.connections if one.is_class_1 and not one.unsupported]
    points = points_of(offered)
    signals = assembly_signals((one.direction, one.instance, one.octets, one.members) for one in points)
    assert len({signal.name for signal in signals}) == len(signals)
    octets = {(one.direction, one.instance): one.octets for one in points}
    for signal in signals:
        signal.read(bytes(octets[signal.direction, signal.slot]))
    for one in offered:
        offer = offer_of(one, strict=True)
        assert offer.consumed_size in offer.consumed_sizes
        way = one.configuration
        data = composed(way.size.default, way.members, lambda parameter: parameter.encode(parameter.default))
        assert len(data) == offer.configuration_octets
        for member in way.members:
            if member.parameter is not None:
                member.parameter.complaint(member.take(data))


def plug_every_module(data: bytes) -> None:
    """A slave of PROFIBUS; raises as :func:`plug_everything` does."""
    gsd = parse_gsd_file(data)
    slave_drive = catalogue.model("profidrive-dp")
    with suppress(ConfigError):
        Product.of(with_identity(slave_drive, maker_identity.identity_of(gsd, slave_drive).overrides))
    choices: list[dict[int, str | int | None]] = [{}]
    choices += [{slot: module.name} for slot in (1, gsd.most_modules) for module in gsd.modules[:MOST]]
    choices += [dict.fromkeys(range(1, gsd.most_modules + 1), module.number) for module in gsd.modules[:MOST]]
    for modules in choices:
        with suppress(gsd_values.PlugError):
            slave = plug_slave(gsd, modules)
            assert slave.takes(slave.identifiers)
            assert len(slave.identifiers) <= 244 >= max(slave.inputs, slave.outputs)
            slave.complaint(slave.user)
            for module in slave.modules:
                for _, value in module.item.parameters.values:
                    with suppress(gsd_values.PlugError):
                        module.item.parameters.changed({value.name: value.default})
