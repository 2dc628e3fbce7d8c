"""Assembly object, class 0x04 (CIP volume 1, chapter 5A-5)."""

from __future__ import annotations

from collections.abc import Callable, Iterable  # noqa: TC003 - fields of a dataclass
from dataclasses import dataclass

from pnfarm.protocols.enip.connection_check import ASSEMBLY
from pnfarm.protocols.enip.object import Attribute, AttributeObject
from pnfarm.protocols.enip.objects.identity import class_attributes
from pnfarm.protocols.enip.wire.data_types import UINT, Value

__all__ = ["AssemblyData", "assembly_object"]


@dataclass(frozen=True, slots=True)
class AssemblyData:
    """One instance: ``read`` gives its ``octets`` octets now; ``write`` takes as many and answers a general status."""

    instance: int
    octets: int
    read: Callable[[], bytes]
    write: Callable[[bytes], int] | None = None


def assembly_object(assemblies: Iterable[AssemblyData]) -> AttributeObject:
    """Attribute 3 is the data, 4 their size; the revision of the class is 2."""
    instances = {one.instance: _instance(one) for one in assemblies}
    return AttributeObject(ASSEMBLY, {0: class_attributes(2, max(instances, default=0)), **instances})


def _instance(one: AssemblyData) -> dict[int, Attribute]:
    def write(value: Value) -> int:
        assert one.write is not None
        assert isinstance(value, bytes)
        return one.write(value)

    data = Attribute(None, one.read, write if one.write else None, one.octets)
    return {3: data, 4: Attribute(UINT, lambda: one.octets)}
