"""A model as a GSD file."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.buses.profibus.device.extended_diagnosis import channel_error, extended_octets
from pnfarm.buses.profibus.device.product import Product
from pnfarm.errors import ConfigError
from pnfarm.protocols.profibus.gsd.writer import GsdModule, SlaveDescription
from pnfarm.protocols.profibus.wire.dp import V1Status1, parse_identifiers

if TYPE_CHECKING:
    from pnfarm.drives.description.model import Model

__all__ = ["describe_model", "file_name"]

#: Slave_Family: drives.
_DRIVES = 1


def describe_model(model: Model) -> SlaveDescription:
    """Raises :class:`ConfigError` for a model on another bus."""
    if model.bus != "profibus":
        raise ConfigError(f"{model.name} is on {model.bus}: a GSD file describes a slave of PROFIBUS")
    product, identity, sheet = Product.of(model), model.profidrive.identity, model.description_file
    telegrams = [one for one in model.profidrive.telegrams.values() if one.identifiers]
    lengths = [
        max(sum(one.inputs for one in parts), sum(one.outputs for one in parts))
        for parts in (parse_identifiers(telegram.identifiers) for telegram in telegrams)
    ]
    major, minor, patch = identity.software_version
    return SlaveDescription(
        vendor=model.maker,
        model=identity.station_type if sheet is None else sheet.family,
        revision=f"pnfarm {'' if sheet is None else sheet.date}".strip(),
        ident=identity.device_id,
        hardware=f"V{identity.hardware_revision}.0",
        software=f"{identity.software_prefix}{major}.{minor}.{patch}",
        family=_DRIVES,
        rates=list(zip(product.baud_rates, product.max_tsdr_bits, strict=True)),
        interval_ns=model.limits.min_cycle_ns,
        freeze=product.freeze,
        sync=product.sync,
        fail_safe=product.fail_safe,
        address_changes=product.address_changes,
        auto_baud=True,
        modules=[GsdModule(one.name, one.identifiers, one.number) for one in telegrams],
        longest=max(lengths),
        diagnosis=6 + extended_octets(product),
        parameters=bytes((int(V1Status1.DPV1_ENABLE), 0, 0)),
        v1=True,
        longest_record=product.longest_record,
        connections=product.connections,
        channel_errors={} if product.diagnosis_parameter is not None else _channel_errors(model),
        comments=() if sheet is None else (sheet.info_text,),
    )


def _channel_errors(model: Model) -> dict[int, str]:
    """Of each error the first fault that has it."""
    return {
        channel_error(error_type): model.faults[number].name
        for number, error_type in sorted(model.diagnoses.items(), reverse=True)
    }


def file_name(model: Model) -> str:
    """Eight letters and .gsd, as tools of all ages want it: maker and ident number."""
    return f"{model.maker[:4].upper():_<4}{model.profidrive.identity.device_id:04X}.gsd"
