"""The toy bus's frames of a capture in words."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.captures.packet import Description
from toybus.frames import ETHERTYPE, ORDER, parse_order, parse_report

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from pnfarm.captures.decoder import PlannedDrive
    from pnfarm.captures.packet import Packet


class ToyDecoder:
    """A :class:`pnfarm.captures.decoder.FrameDecoder`."""

    def __init__(self, capture: object) -> None:
        pass

    def family_of(self, packet: Packet) -> str | None:
        return "toy" if packet.ethertype == ETHERTYPE else None

    def describe(self, family: str, packet: Packet) -> Iterator[Description]:
        if packet.payload[:1] == bytes([ORDER]):
            order = parse_order(packet.payload)
            yield Description("order", f"{order.speed} rpm" if order.enable else "stop", counts={"orders": ""})
        else:
            yield Description("report", f"{parse_report(packet.payload).speed} rpm")

    def cyclic_channels(self) -> Sequence[object]:
        return ()

    def expect(self, controller: str, mac: bytes, drives: Sequence[PlannedDrive]) -> None:
        pass
