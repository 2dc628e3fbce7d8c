"""identity-change: another product seems to stand there."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.buses.ethernetip.faults.identity import IDENTITY, OtherIdentity
from pnfarm.faults.effects.effect import Effect, Tally, Window
from pnfarm.faults.kind import HELD, OCTET, WORD, InjectionKind, ParamSpec
from pnfarm.protocols.enip.connection import ConnectionRefused
from pnfarm.protocols.enip.status import ConnectionStatus

if TYPE_CHECKING:
    from pnfarm.faults.effects.evidence import Evidence
    from pnfarm.faults.effects.injection_fields import InjectionFields
    from pnfarm.faults.effects.parts import InjectedDrive
    from pnfarm.protocols.enip.connection import ManagerEvent

__all__ = ["KINDS"]

_MISMATCHES = frozenset({
    ConnectionStatus.VENDOR_OR_PRODUCT_MISMATCH,
    ConnectionStatus.DEVICE_TYPE_MISMATCH,
    ConnectionStatus.REVISION_MISMATCH,
})  # fmt: skip


class IdentityChange(Effect):
    """Confirmed by a Forward_Open whose electronic key no longer fits."""

    needs = (IDENTITY,)

    def __init__(self, spec: InjectionFields, drive: InjectedDrive) -> None:
        super().__init__(spec, drive)
        self._identity = drive.part(IDENTITY)
        self._tally = Tally()
        self._stands = False
        values = self.values
        names = {"vendor": "vendor_id"}
        given = {names.get(name, name): values[name] for name in values}
        change = OtherIdentity(**given)
        if change.is_own:
            change = OtherIdentity(product_code=(self._identity.own.product_code or 0) + 1 & 0xFFFF)
        self._change = change

    def begin(self, window: Window, now: int) -> None:
        del window
        self._stands = True
        self._identity.listen(self._hear)
        self._identity.change(self._change)
        self._tally.note(now)

    def _hear(self, event: ManagerEvent, now: int) -> None:
        del now
        if isinstance(event, ConnectionRefused) and _MISMATCHES.intersection(event.extended[:1]):
            self._tally.confirm()

    def end(self, now: int) -> None:
        del now
        if self._stands:
            self._stands = False
            self._identity.unlisten(self._hear)
            self._identity.restore(self._change)

    def evidence(self) -> Evidence:
        return self._tally.seen


KINDS = (
    InjectionKind(
        "identity-change",
        "connection",
        "The drive looks like another product: vendor, device type, product code, revision or serial number differ.  A "
        "connection that exists continues, a new one whose electronic key names the right product is refused.  "
        "Without any of these the product code is one higher.",
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
        wire=(
            "Identity object and ListIdentity say something else; Forward_Open with a key that does not fit is refused "
            "with 0x01 and 0x0114, 0x0115 or 0x0116."
        ),
        reports=(
            "A running connection stays. A new one: Logix: module fault 16#0114 to 16#0116, electronic keying "
            "mismatch, unless keying is disabled; CODESYS: the adapter is not found as configured (assumed)."
        ),
    ),
)
