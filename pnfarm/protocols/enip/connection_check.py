"""Whether a Forward_Open fits what the target offers: each refusal with its extended status (CIP volume 1, 3-5.5.2)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from pnfarm.errors import DecodeError
from pnfarm.protocols.enip.connection import (
    MAXIMUM_MULTIPLIER,
    ConnectionKind,
    ConnectionSettings,
    IoOffer,
    RpiBelowMinimum,
)
from pnfarm.protocols.enip.status import ConnectionStatus as Status
from pnfarm.protocols.enip.status import GeneralStatus
from pnfarm.protocols.enip.wire.epath import (
    DataSegment,
    ElectronicKey,
    Logical,
    LogicalSegment,
    NetworkSegment,
    Segment,
    parse_epath,
)
from pnfarm.protocols.enip.wire.forward_open import ConnectionType, ForwardOpen

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["ASSEMBLY", "ApplicationPath", "Refusal", "check_explicit", "check_io", "check_key", "read_path"]

ASSEMBLY: Final = 0x04
_POINTS: Final = {Logical.INSTANCE, Logical.CONNECTION_POINT}
#: Subtype of the network segment with the production inhibit time, ms.
_INHIBIT: Final = 3


class Refusal(Exception):  # noqa: N818 - an answer, not an error of this program
    """Why a Forward_Open is refused: general status, extended status with the words after it."""

    def __init__(self, *extended: int, status: int = GeneralStatus.CONNECTION_FAILURE) -> None:
        super().__init__(*extended)
        self.extended = extended
        self.status = status


@dataclass(frozen=True, slots=True)
class ApplicationPath:
    """A connection path taken apart; ``points`` are instances and connection points in their order.

    ``inhibit_us`` is the production inhibit time, 0 without one.
    """

    key: ElectronicKey | None
    class_id: int
    points: tuple[int, ...]
    configuration: bytes
    inhibit_us: int = 0


def read_path(path: bytes) -> ApplicationPath:
    """Raises :class:`Refusal` 0x0315 for a segment that does not belong there."""
    try:
        segments: Sequence[Segment] = parse_epath(path)
    except DecodeError as exc:
        raise Refusal(Status.INVALID_SEGMENT) from exc
    key, class_id, points, configuration, inhibit_us = None, None, [], b"", 0
    for place, segment in enumerate(segments):
        match segment:
            case ElectronicKey() if place == 0:
                key = segment
            case LogicalSegment(Logical.CLASS, value) if class_id in {None, value}:
                class_id = value
            case LogicalSegment(kind, value) if kind in _POINTS and class_id is not None:
                points.append(value)
            case NetworkSegment(subtype, data):
                if subtype == _INHIBIT and data:
                    inhibit_us = data[0] * 1000
            case DataSegment(data) if class_id is not None:
                configuration += data
            case _:
                raise Refusal(Status.INVALID_SEGMENT)
    if class_id is None:
        raise Refusal(Status.INVALID_SEGMENT)
    return ApplicationPath(key, class_id, tuple(points), configuration, inhibit_us)


def check_key(key: ElectronicKey | None, own: ElectronicKey) -> None:
    """A number of 0 stands for any, a major revision of 0 for any revision.

    With the compatibility bit, a lower minor revision of the same major one fits.
    """
    if key is None:
        return
    if key.vendor_id not in {0, own.vendor_id} or key.product_code not in {0, own.product_code}:
        raise Refusal(Status.VENDOR_OR_PRODUCT_MISMATCH)
    if key.device_type not in {0, own.device_type}:
        raise Refusal(Status.DEVICE_TYPE_MISMATCH)
    if key.major_revision not in {0, own.major_revision}:
        raise Refusal(Status.REVISION_MISMATCH)
    minor_fits = (
        key.major_revision == 0
        or key.minor_revision in {0, own.minor_revision}
        or (key.compatible and key.minor_revision <= own.minor_revision)
    )
    if not minor_fits:
        raise Refusal(Status.REVISION_MISMATCH)


def check_io(request: ForwardOpen, path: ApplicationPath, settings: ConnectionSettings) -> IoOffer:
    """The offer that a class 1 connection asks for; raises :class:`Refusal`."""
    if request.o_to_t.kind == request.t_to_o.kind == ConnectionType.NULL:
        raise Refusal(settings.null_open_status)
    triggers = {trigger for offer in settings.offers for trigger in offer.triggers}
    if request.transport.transport != 1 or request.transport.trigger not in triggers:
        raise Refusal(Status.TRANSPORT_CLASS_AND_TRIGGER)
    if request.transport.server:
        raise Refusal(Status.DIRECTION_NOT_SUPPORTED)
    offers = _find_offers(path, settings)
    # several offers may have the same points: the one that is meant has the size
    offer = next((one for one in offers if _fits(request, one)), offers[0])
    if request.transport.trigger not in offer.triggers:
        raise Refusal(Status.TRANSPORT_CLASS_AND_TRIGGER)
    if request.o_to_t.kind != ConnectionType.POINT_TO_POINT:
        raise Refusal(Status.O_TO_T_CONNECTION_TYPE)
    if request.t_to_o.kind not in offer.produced_types:
        raise Refusal(Status.T_TO_O_CONNECTION_TYPE)
    if offer.kind is ConnectionKind.LISTEN_ONLY and request.t_to_o.kind != ConnectionType.MULTICAST:
        raise Refusal(Status.T_TO_O_CONNECTION_TYPE)
    if request.o_to_t.redundant_owner:
        raise Refusal(Status.O_TO_T_REDUNDANT_OWNER)
    if request.o_to_t.variable not in offer.consumed_variable:
        raise Refusal(Status.O_TO_T_FIXED_OR_VARIABLE)
    if request.t_to_o.variable not in offer.produced_variable:
        raise Refusal(Status.T_TO_O_FIXED_OR_VARIABLE)
    if request.o_to_t.size not in offer.consumed_sizes:
        raise Refusal(Status.O_TO_T_SIZE, offer.consumed_size)
    if request.t_to_o.size not in offer.produced_sizes:
        raise Refusal(Status.T_TO_O_SIZE, offer.produced_size)
    # a data segment has whole words
    if len(path.configuration) != offer.configuration_octets + offer.configuration_octets % 2:
        raise Refusal(Status.CONFIGURATION_SIZE, offer.configuration_octets)
    _check_intervals(request, offer, settings)
    if path.inhibit_us > request.t_to_o_rpi_us:
        raise Refusal(Status.RPI_BELOW_INHIBIT_TIME)
    return offer


def check_explicit(request: ForwardOpen, path: ApplicationPath, settings: ConnectionSettings) -> None:
    """A class 3 connection to the Message Router, which has one instance; raises :class:`Refusal`."""
    if request.transport.transport != 3 or not request.transport.server:
        raise Refusal(Status.TRANSPORT_CLASS_AND_TRIGGER)
    if path.points != (1,) or path.configuration:
        raise Refusal(Status.INVALID_SEGMENT if path.points else Status.INCONSISTENT_APPLICATION_PATHS)
    if request.o_to_t.kind != ConnectionType.POINT_TO_POINT:
        raise Refusal(Status.O_TO_T_CONNECTION_TYPE)
    if request.t_to_o.kind != ConnectionType.POINT_TO_POINT:
        raise Refusal(Status.T_TO_O_CONNECTION_TYPE)
    longest = settings.large_explicit_size if request.large else settings.explicit_size
    for size in (request.o_to_t.size, request.t_to_o.size):
        if not 8 <= size <= longest:
            raise Refusal(Status.INVALID_CONNECTION_SIZE, longest)
    _check_timeout(request)


def _fits(request: ForwardOpen, offer: IoOffer) -> bool:
    return request.o_to_t.size in offer.consumed_sizes and request.t_to_o.size in offer.produced_sizes


def _find_offers(path: ApplicationPath, settings: ConnectionSettings) -> list[IoOffer]:
    """Those with the points of a path, at least one."""
    if path.class_id != ASSEMBLY:
        raise Refusal(Status.APPLICATION_PATH if settings.paths_told_apart else Status.INCONSISTENT_APPLICATION_PATHS)
    configuration: int | None = None
    match path.points:
        case (configuration, consumed, produced):
            pass
        case (consumed, produced):
            pass
        case _:
            # a point is missing, or is one too many
            raise Refusal(Status.APPLICATION_PATH if settings.paths_told_apart else Status.INVALID_SEGMENT)
    found = [
        offer
        for offer in settings.offers
        if configuration in {None, offer.configuration} and (offer.consumed, offer.produced) == (consumed, produced)
    ]
    if found:
        return found
    if settings.paths_told_apart:
        if configuration is not None and all(configuration != offer.configuration for offer in settings.offers):
            raise Refusal(Status.CONFIGURATION_APPLICATION_PATH)
        if all(consumed != offer.consumed for offer in settings.offers):
            raise Refusal(Status.CONSUMING_APPLICATION_PATH)
        if all(produced != offer.produced for offer in settings.offers):
            raise Refusal(Status.PRODUCING_APPLICATION_PATH)
    raise Refusal(Status.INCONSISTENT_APPLICATION_PATHS)


def _check_timeout(request: ForwardOpen) -> None:
    if request.timeout_multiplier > MAXIMUM_MULTIPLIER:
        raise Refusal(Status.TIMEOUT_MULTIPLIER)
    if request.o_to_t_rpi_us == 0:
        raise Refusal(Status.RPI_NOT_SUPPORTED)


def _check_intervals(request: ForwardOpen, offer: IoOffer, settings: ConnectionSettings) -> None:
    _check_timeout(request)
    for rpi, limits in (
        (request.o_to_t_rpi_us, offer.consumed_rpi_us),
        (request.t_to_o_rpi_us, offer.produced_rpi_us),
    ):
        if limits is not None and not limits[0] <= rpi <= limits[1]:
            raise Refusal(Status.RPI_NOT_SUPPORTED)
    for rpi in (request.o_to_t_rpi_us, request.t_to_o_rpi_us):
        if rpi == 0 or rpi > settings.maximum_rpi_us:
            raise Refusal(Status.RPI_NOT_SUPPORTED)
        if rpi < settings.minimum_rpi_us and settings.below_minimum is RpiBelowMinimum.REFUSE:
            raise Refusal(Status.RPI_NOT_SUPPORTED)
