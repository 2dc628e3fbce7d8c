"""identity-change: another product seems to be there."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.buses.ethernetip.faults.identity import IDENTITY, OtherIdentity
from pnfarm.faults.effects.effect import Effect
from pnfarm.faults.kind import HELD, OCTET, WORD, InjectionKind, ParamSpec
from pnfarm.protocols.enip.connection import ConnectionRefused
from pnfarm.protocols.enip.status import ConnectionStatus

if TYPE_CHECKING:
    from pnfarm.protocols.enip.connection import ManagerEvent

__all__ = ["KIND"]

_MISMATCHES = frozenset({
    ConnectionStatus.VENDOR_OR_PRODUCT_MISMATCH,
    ConnectionStatus.DEVICE_TYPE_MISMATCH,
    ConnectionStatus.REVISION_MISMATCH,
})  # fmt: skip


class IdentityChange(Effect):
    """Confirmed by a Forward_Open whose electronic key no longer fits."""

    identity = IDENTITY

    def prepare(self) -> None:
        given = {"vendor_id" if name == "vendor" else name: value for name, value in self.values.items()}
        self._change = OtherIdentity(**given)
        if self._change.is_own:
            self._change = OtherIdentity(product_code=(self.identity.own.product_code or 0) + 1 & 0xFFFF)

    def begin(self, now: int) -> None:
        self.identity.listen(self._hear)
        self.identity.change(self._change)
        self.tally.note(now)

    def _hear(self, event: ManagerEvent, now: int) -> None:
        del now
        if isinstance(event, ConnectionRefused) and _MISMATCHES.intersection(event.extended[:1]):
            self.tally.confirm()

    def take(self) -> None:
        self.identity.unlisten(self._hear)
        self.identity.restore(self._change)


KIND = InjectionKind(
    "identity-change",
    "connection",
    "The drive looks like another product: vendor, device type, product code, revision or serial number differ.  An "
    "open connection continues; a new one whose electronic key names the right product is refused.  Without "
    "parameters, the product code is higher by one.",
    "the change",
    IdentityChange,
    {
        "vendor": ParamSpec("whole number", "Vendor id.", **WORD),
        "device_type": ParamSpec("whole number", "Device type.", **WORD),
        "product_code": ParamSpec("whole number", "Product code.", **WORD),
        "major": ParamSpec("whole number", "Major revision.", low=1, high=127),
        "minor": ParamSpec("whole number", "Minor revision.", **OCTET),
        "serial": ParamSpec("whole number", "Serial number, which is in no key.", low=0, high=0xFFFFFFFF),
    },
    takes=HELD,
    place=74,
    wire="Identity object and ListIdentity have other values; Forward_Open with a key that does not fit is refused "
    "with 0x01 and 0x0114, 0x0115 or 0x0116.",
    reports="A running connection stays. A new one: Logix: module fault 16#0114 to 16#0116, electronic keying "
    "mismatch, unless keying is disabled; CODESYS: the adapter is not found as configured (assumed).",
)
