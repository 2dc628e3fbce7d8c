"""What a CIP object is to the Message Router, and an object whose attributes are a table.

An object is one class with its instances; instance 0 is the class itself.  The router takes paths apart, carries out
Get_Attribute_Single, Set_Attribute_Single, Get_Attribute_List and Multiple_Service_Packet, and leaves every other
service to the object.  It also holds that class and instance exist before it asks.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Protocol

from pnfarm.errors import DecodeError
from pnfarm.protocols.enip.status import GeneralStatus, Service
from pnfarm.protocols.enip.wire.data_types import UINT, CipType, Value
from pnfarm.wire.octets import Reader, Writer

if TYPE_CHECKING:
    from collections.abc import Callable, Container, Mapping

__all__ = ["SUCCESS", "Answer", "Attribute", "AttributeObject", "CipObject", "cut_or_long", "refused", "size_status"]


@dataclass(frozen=True, slots=True)
class Answer:
    """What an object answers: general status, extended status in words, data."""

    status: int = GeneralStatus.SUCCESS
    data: bytes = b""
    extended: tuple[int, ...] = ()

    @property
    def ok(self) -> bool:
        return self.status == GeneralStatus.SUCCESS


SUCCESS = Answer()


def refused(status: int, *extended: int) -> Answer:
    return Answer(status, b"", extended)


def cut_or_long(error: DecodeError) -> Answer:
    """The answer to data that end too early, or go on after their end."""
    return refused(GeneralStatus.NOT_ENOUGH_DATA if error.reason == "short" else GeneralStatus.TOO_MUCH_DATA)


def size_status(length: int, size: int) -> GeneralStatus:
    """Of data that should have ``size`` octets."""
    if length == size:
        return GeneralStatus.SUCCESS
    return GeneralStatus.NOT_ENOUGH_DATA if length < size else GeneralStatus.TOO_MUCH_DATA


class CipObject(Protocol):
    """One class; implemented here for the standard's objects, and in the drive's room for its own."""

    @property
    def class_id(self) -> int: ...

    @property
    def instances(self) -> Container[int]:
        """Numbers of the instances, without the class's 0."""

    def get(self, instance: int, attribute: int) -> Answer:
        """The attribute's octets, or a status such as ``ATTRIBUTE_NOT_SUPPORTED``."""

    def set(self, instance: int, attribute: int, data: bytes) -> Answer:
        """Write an attribute: all octets after the path."""

    def service(self, instance: int, service: int, data: bytes) -> Answer:
        """Any service beside those of the router; ``SERVICE_NOT_SUPPORTED`` for one that the object lacks."""


@dataclass(frozen=True, slots=True)
class Attribute:
    """``read`` gives the value now; ``write`` takes one and answers a general status, None for a read-only attribute.

    ``kind`` is the type, None for a structure whose octets ``read`` and ``write`` handle themselves; ``size`` is then
    the number of octets in Set_Attribute_List and Set_Attributes_All.
    """

    kind: CipType | None
    read: Callable[[], Value]
    write: Callable[[Value], int] | None = None
    size: int | None = None


def _no_service(instance: int, service: int, data: bytes) -> Answer:  # noqa: ARG001 - the shape of a service
    return refused(GeneralStatus.SERVICE_NOT_SUPPORTED)


@dataclass(slots=True)
class AttributeObject:
    """An object over plain data: for each instance its attributes; instance 0 holds the class's.

    ``all_of`` are the attributes of Get_Attributes_All in their order, for each instance that has the service;
    ``more`` carries out further services.
    """

    class_id: int
    attributes: Mapping[int, Mapping[int, Attribute]]
    all_of: Mapping[int, tuple[int, ...]] = field(default_factory=dict)
    more: Callable[[int, int, bytes], Answer] = _no_service

    @property
    def instances(self) -> Container[int]:
        return self.attributes.keys() - {0}

    def get(self, instance: int, attribute: int) -> Answer:
        found = self.attributes.get(instance, {}).get(attribute)
        if found is None:
            return refused(GeneralStatus.ATTRIBUTE_NOT_SUPPORTED)
        return Answer(data=_octets(found))

    def set(self, instance: int, attribute: int, data: bytes) -> Answer:
        found = self.attributes.get(instance, {}).get(attribute)
        if found is None:
            return refused(GeneralStatus.ATTRIBUTE_NOT_SUPPORTED)
        if found.write is None:
            return refused(GeneralStatus.ATTRIBUTE_NOT_SETTABLE)
        if found.kind is None:
            wrong = size_status(len(data), len(data) if found.size is None else found.size)
            return refused(wrong or found.write(data))
        try:
            value = found.kind.parse(data)
        except DecodeError as exc:
            return cut_or_long(exc)
        return refused(found.write(value))

    def service(self, instance: int, service: int, data: bytes) -> Answer:
        if service == Service.GET_ATTRIBUTES_ALL and instance in self.all_of:
            w = Writer(little=True)
            for number in self.all_of[instance]:
                w.bytes(_octets(self.attributes[instance][number]))
            return Answer(data=w.getvalue())
        if service == Service.SET_ATTRIBUTE_LIST and any(
            attribute.write is not None for attribute in self.attributes.get(instance, {}).values()
        ):
            return self._set_list(instance, data)
        return self.more(instance, service, data)

    def _set_list(self, instance: int, data: bytes) -> Answer:
        """``Count u16``, then ``Number u16, Data`` each; the reply has ``Number u16, Status u16`` for each.

        Where an attribute's length is not known, the rest cannot be read (CIP volume 1, appendix A-4.4).
        """
        r, w, status = Reader(data, little=True), Writer(little=True), int(GeneralStatus.SUCCESS)
        try:
            count = r.u16()
            w.u16(count)
            for place in range(count):
                number = r.u16()
                found = self.attributes.get(instance, {}).get(number)
                size = None if found is None else found.size if found.kind is None else found.kind.size
                if found is None or size is None:
                    status = GeneralStatus.ATTRIBUTE_LIST_ERROR
                    w.u16(number).u16(GeneralStatus.ATTRIBUTE_NOT_SUPPORTED)
                    return Answer(status, UINT.emit(place + 1) + w.getvalue()[2:])
                answer = self.set(instance, number, r.bytes(size))
                status = status if answer.ok else GeneralStatus.ATTRIBUTE_LIST_ERROR
                w.u16(number).u16(answer.status)
            r.expect_end()
        except DecodeError as exc:
            return cut_or_long(exc)
        return Answer(status, w.getvalue())


def _octets(attribute: Attribute) -> bytes:
    value = attribute.read()
    if attribute.kind is not None:
        return attribute.kind.emit(value)
    assert isinstance(value, bytes)
    return value
