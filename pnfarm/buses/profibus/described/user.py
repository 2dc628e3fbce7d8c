"""The station behind a described slave: plain data, parameters and records that are kept."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from pnfarm.buses.profibus.device.kind import Meddling
from pnfarm.protocols.profibus.slave_user import RecordRefusedError
from pnfarm.protocols.profibus.wire.dp import HEAD_OCTETS
from pnfarm.protocols.profibus.wire.dpv1 import ErrorCode1

if TYPE_CHECKING:
    from pnfarm.buses.profibus.described.station import DescribedSlave
    from pnfarm.buses.profibus.device.image import CyclicImage
    from pnfarm.protocols.profibus.wire.dp import Parameters
    from pnfarm.table.access.plain_data import ConsumedData, ProvidedData

__all__ = ["DescribedUser"]

#: Records that a device keeps.
MOST_RECORDS: Final = 1024


class DescribedUser(Meddling):
    """See :class:`pnfarm.protocols.profibus.slave_user.SlaveUser`.  Made again at each power-on.

    A written record is kept and read back until power-off; one that was never written is refused with "invalid index",
    and a slot without a module with "invalid slot" (assumed: a GSD file does not describe records).
    """

    def __init__(
        self,
        described: DescribedSlave,
        image: CyclicImage,
        inputs: ProvidedData,
        outputs: ConsumedData,
        *,
        strict: bool,
    ) -> None:
        super().__init__()
        self._plugged = described.plugged
        self.most_further = described.plugged.gsd.most_diagnosis - HEAD_OCTETS
        self._slots = frozenset({0, *(module.slot for module in described.plugged.modules)})
        self._image, self._inputs, self._outputs = image, inputs, outputs
        self._strict = strict
        self._records: dict[tuple[int, int], bytes] = {}
        #: The user's octets of the last Set_Prm that was taken.
        self.parameters = b""
        self.output_octets = described.plugged.outputs
        image.without_words(described.plugged.outputs, described.plugged.inputs)

    # -- cyclic data -------------------------------------------------------------------------------------------------

    def take_outputs(self, data: bytes, now: int) -> None:
        self._outputs.take(data, good=True)
        self._image.note(now)

    def clear_outputs(self, now: int) -> None:
        self.without_master()
        self._image.clear(now)

    def without_master(self) -> None:
        """No master sends outputs: they are zero, with status BAD."""
        self._outputs.take(bytes(self.output_octets), good=False)

    def inputs(self) -> bytes:
        return self._inputs.read()

    def exchanged(self, now: int) -> None:
        self._image.exchanged(now)

    # -- start-up ----------------------------------------------------------------------------------------------------

    def check_parameters(self, parameters: Parameters) -> str | None:
        """What the file does not allow is refused, on a device with strict limits."""
        return self._plugged.complaint(parameters.user) if self._strict else None

    def check_configuration(self, identifiers: bytes) -> bool:
        return self._plugged.takes(identifiers)

    def configuration(self) -> bytes:
        return self._plugged.identifiers

    # -- diagnosis ---------------------------------------------------------------------------------------------------

    def diagnosis(self) -> tuple[bool, bool, bytes]:
        """It has what injections add."""
        return bool(self.further_diagnosis), self.static_diagnosis, self.further_diagnosis

    # -- records -----------------------------------------------------------------------------------------------------

    def read_record(self, slot: int, index: int, length: int, client: int, now: int) -> bytes | None:
        self._refuse(slot)
        if self.withhold is not None and self.withhold(client, now):
            return None
        found = self._records.get((slot, index))
        if found is None:
            raise RecordRefusedError(ErrorCode1.INVALID_INDEX)
        return found[:length]

    def write_record(self, slot: int, index: int, data: bytes, client: int, now: int) -> bool:
        del client, now
        self._refuse(slot)
        if len(self._records) >= MOST_RECORDS and (slot, index) not in self._records:
            raise RecordRefusedError(ErrorCode1.RESOURCE_UNAVAILABLE)
        self._records[slot, index] = data
        return True

    def _refuse(self, slot: int) -> None:
        if self.error is not None:
            self.given()
            raise RecordRefusedError(*self.error)
        if slot not in self._slots:
            raise RecordRefusedError(ErrorCode1.INVALID_SLOT)
