"""The drive behind a slave: its telegrams by identifiers, its image, its parameters as records, its diagnosis."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from pnfarm.buses.profibus.device.extended_diagnosis import channel_diagnosis, extended_diagnosis
from pnfarm.buses.profibus.device.kind import Meddling
from pnfarm.drives.profiles.profidrive.parameter_channel import ParameterChannel
from pnfarm.errors import DecodeError
from pnfarm.protocols.profibus.slave_user import RecordRefusedError
from pnfarm.protocols.profibus.wire.dpv1 import ErrorCode1
from pnfarm.table.access.record_fields import field_views
from pnfarm.table.axis_codes import NUMBER_MASK
from pnfarm.table.signals import WORD_NONE

if TYPE_CHECKING:
    from collections.abc import Callable

    from pnfarm.buses.profibus.device.image import CyclicImage
    from pnfarm.buses.profibus.device.product import Product
    from pnfarm.drives.parameters.store import ParameterStore
    from pnfarm.protocols.profibus.wire.dp import Parameters

__all__ = ["DriveUser"]

#: Data unit index of base mode parameter access (Moog MSD manual 9.1).
PARAMETERS: Final = 47


class DriveUser(Meddling):
    """See :class:`pnfarm.protocols.profibus.slave_user.SlaveUser`.  Made again at each power-on.

    ``latency`` gives the time of the next request for parameters, ns.
    """

    def __init__(
        self,
        store: ParameterStore,
        image: CyclicImage,
        product: Product,
        *,
        strict: bool,
        latency: Callable[[], int] | None,
    ) -> None:
        super().__init__()
        self._store = store
        self._image = image
        self._product = product
        self._strict = strict
        self.channel = ParameterChannel(store, PARAMETERS, strict=strict, latency=latency)
        self._by_identifiers = {
            telegram.identifiers: number
            for number, telegram in store.model.profidrive.telegrams.items()
            if telegram.identifiers
        }
        self._to_plug: int | None = None
        self._errors, self._warning = field_views(store.handle.axis, "faults.code", "warnings.code")
        self.layout()

    # -- cyclic data -------------------------------------------------------------------------------------------------

    def layout(self) -> None:
        """The words of the telegram in force."""
        frame = self._store.telegram
        outputs, inputs = self._store.output_words(), self._store.input_words()
        self._image.layout(
            (outputs + (WORD_NONE,) * len(frame.output))[: len(frame.output)],
            (inputs + (WORD_NONE,) * len(frame.input))[: len(frame.input)],
        )

    @property
    def output_octets(self) -> int:
        return self._image.output_octets

    def take_outputs(self, data: bytes, now: int) -> None:
        self._image.take(data, now)

    def clear_outputs(self, now: int) -> None:
        self._image.clear(now)

    def inputs(self) -> bytes:
        return self._image.shown()

    def exchanged(self, now: int) -> None:
        self._image.exchanged(now)

    # -- start-up ----------------------------------------------------------------------------------------------------

    def check_parameters(self, parameters: Parameters) -> str | None:
        """As many octets of the user as a maker's file has, or more; any without one, as no manual names them."""
        given, wanted = len(parameters.user), len(self._product.parameters)
        return f"{given} octets of parameters instead of {wanted}" if self._strict and given < wanted else None

    def check_configuration(self, identifiers: bytes) -> bool:
        number = self._by_identifiers.get(identifiers)
        if number is None:
            return False
        self._to_plug = number
        return True

    def plug(self) -> None:
        """The telegram that the last Chk_Cfg named is in force from now on."""
        number, self._to_plug = self._to_plug, None
        if number is not None:
            self._store.plug_telegram(number)
            self.layout()

    def configuration(self) -> bytes:
        return self._store.telegram.identifiers

    # -- diagnosis ---------------------------------------------------------------------------------------------------

    @property
    def faulty(self) -> bool:
        """Whether a fault is active."""
        return self._errors[0] != 0

    @property
    def reports_faults(self) -> bool:
        """Whether a fault is in the diagnosis after its first six octets."""
        parameter = self._product.diagnosis_parameter
        return parameter is None or self._store.raw(parameter) in self._product.diagnosis_modes

    def diagnosis(self) -> tuple[bool, bool, bytes]:
        extended = self._extended() + self.further_diagnosis
        return bool(extended) and (self.faulty or bool(self.further_diagnosis)), self.static_diagnosis, extended

    def _extended(self) -> bytes:
        """A status block with error and warning, or the channel's error where the fault has a class."""
        product, error, warning = self._product, self._errors[0] & NUMBER_MASK, self._warning[0] & NUMBER_MASK
        if product.diagnosis_parameter is None:
            return channel_diagnosis(self._store.model.diagnoses.get(error))
        return extended_diagnosis(product, self._store.raw(product.diagnosis_parameter), error, warning)

    # -- records -----------------------------------------------------------------------------------------------------

    def read_record(self, slot: int, index: int, length: int, client: int, now: int) -> bytes | None:
        """Slots are not evaluated (9.1)."""
        del slot
        self._refuse(index)
        if self.withhold is not None and self.channel.pending(client) and self.withhold(client, now):
            return None
        answer = self.channel.read_response(length, client, now)
        if answer is None:
            raise RecordRefusedError(ErrorCode1.STATE_CONFLICT)
        return answer

    def write_record(self, slot: int, index: int, data: bytes, client: int, now: int) -> bool:
        del slot
        self._refuse(index)
        try:
            taken = self.channel.write_request(data, client, now)
        except DecodeError:
            raise RecordRefusedError(ErrorCode1.WRITE_LENGTH) from None
        if not taken:
            raise RecordRefusedError(ErrorCode1.STATE_CONFLICT)
        return True

    def _refuse(self, index: int) -> None:
        if index != PARAMETERS:
            raise RecordRefusedError(ErrorCode1.INVALID_INDEX)
        if self.error is not None:
            self.given()
            raise RecordRefusedError(*self.error)

    def client_gone(self, client: int) -> None:
        super().client_gone(client)
        self.channel.reset(client)
