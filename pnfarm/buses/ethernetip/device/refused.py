"""What a Forward_Open asks for and a station on EtherNet/IP does not have so: sentences, with the farm file's key."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.errors import DecodeError
from pnfarm.protocols.enip.status import ConnectionStatus as Status
from pnfarm.protocols.enip.status import status_text
from pnfarm.protocols.enip.wire.epath import ElectronicKey, Logical, LogicalSegment, parse_epath
from pnfarm.station.visits import Refusal

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pnfarm.buses.ethernetip.device.kind import Kind
    from pnfarm.protocols.enip.connection import ConnectionRefused

__all__ = ["of_forward_open"]

#: Extended status -> what of the request does not fit.
_SUBJECTS: Mapping[int, str] = {
    **dict.fromkeys((Status.VENDOR_OR_PRODUCT_MISMATCH, Status.DEVICE_TYPE_MISMATCH, Status.REVISION_MISMATCH), "key"),
    **dict.fromkeys((Status.O_TO_T_SIZE, Status.T_TO_O_SIZE, Status.CONFIGURATION_SIZE), "sizes"),
    **dict.fromkeys((Status.RPI_NOT_SUPPORTED, Status.RPI_NOT_ACCEPTABLE), "interval"),
    **dict.fromkeys(
        (
            Status.APPLICATION_PATH, Status.CONFIGURATION_APPLICATION_PATH, Status.CONSUMING_APPLICATION_PATH,
            Status.PRODUCING_APPLICATION_PATH, Status.INCONSISTENT_APPLICATION_PATHS,
        ),
        "path",
    ),
}  # fmt: skip


def of_forward_open(event: ConnectionRefused, own: ElectronicKey, kind: Kind) -> Refusal:
    """``own`` is the station's electronic key."""
    text = f"Forward_Open refused: {status_text(event.status, event.extended)}"
    subject = _SUBJECTS.get(event.extended[0] if event.extended else 0, "")
    if asked := _asked(event, own, subject):
        text += f"; {asked}"
    return Refusal(text, kind.keys.get(subject, ()), works=False)


def _asked(event: ConnectionRefused, own: ElectronicKey, subject: str) -> str:
    """What the originator asks for, and what is there."""
    request = event.request
    try:
        path = parse_epath(request.path)
    except DecodeError:
        return ""
    match subject:
        case "key":
            key = next((one for one in path if isinstance(one, ElectronicKey)), None)
            return f"it expects {_key_text(key)}, this is {_key_text(own)}" if key is not None else ""
        case "path":
            points = [
                str(one.value)
                for one in path
                if isinstance(one, LogicalSegment) and one.kind in {Logical.INSTANCE, Logical.CONNECTION_POINT}
            ]
            return f"it asks for assemblies {', '.join(points) or 'of none'}"
        case "sizes":
            octets = f"it asks for {request.o_to_t.size} octets to the device and {request.t_to_o.size} from it"
            return octets + (f", {event.extended[1]} would fit" if len(event.extended) > 1 else "")
        case "interval":
            rpis = request.o_to_t_rpi_us / 1000, request.t_to_o_rpi_us / 1000
            return f"it asks for {rpis[0]:g} ms to the device and {rpis[1]:g} ms from it"
        case _:
            return ""


def _key_text(key: ElectronicKey) -> str:
    return (
        f"vendor {key.vendor_id}, type {key.device_type}, product {key.product_code}, "
        f"revision {key.major_revision}.{key.minor_revision}"
    )
