"""connect-refuse: the drive refuses connections."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.buses.profinet.faults.set_up import SET_UP
from pnfarm.faults.effect import Chance, Effect, Window
from pnfarm.faults.kind import EACH, OCTET, InjectionKind, ParamSpec, words_of
from pnfarm.protocols.profinet.errors import CmrpcError, ConnectFault, ErrorCode, pnio_error

if TYPE_CHECKING:
    from pnfarm.faults.evidence import Evidence
    from pnfarm.faults.given import GivenInjection
    from pnfarm.faults.parts import InjectedDrive
    from pnfarm.protocols.profinet.errors import PnioStatus

__all__ = ["KINDS"]


class ConnectRefuse(Effect):
    """Each Connect that requests cyclic data."""

    needs = (SET_UP,)

    def __init__(self, spec: GivenInjection, drive: InjectedDrive) -> None:
        super().__init__(spec, drive)
        self._set_up = drive.part(SET_UP)
        self._chance = Chance(spec, drive, spec.count)
        self._status = pnio_error(ErrorCode.CONNECT, self.values["code1"], self.values["code2"])

    def begin(self, window: Window, now: int) -> None:
        del window, now
        self._set_up.hook_connect(self._asked)

    def _asked(self, now: int) -> PnioStatus | None:
        if self.finished:
            return None
        happens = self._chance.happens()
        self._chance.tally.note(now, happened=happens, confirmed=happens)
        self.finished = self._chance.exhausted
        return self._status if happens else None

    def end(self, now: int) -> None:
        del now
        self._set_up.unhook_connect(self._asked)

    def evidence(self) -> Evidence:
        return self._chance.tally.seen


KINDS = (
    InjectionKind(
        "connect-refuse",
        "connection",
        "The drive refuses connections (PNIOStatus DB 81 and two codes).",
        "a Connect request that is refused",
        ConnectRefuse,
        {
            "code1": ParamSpec(
                "whole number",
                "ErrorCode1: the block or protocol machine.",
                default="cmrpc",
                words=words_of(ConnectFault),
                **OCTET,
            ),
            "code2": ParamSpec(
                "whole number",
                "ErrorCode2; the words are those of CMRPC.",
                default="out-of-ar-resources",
                words=words_of(CmrpcError),
                **OCTET,
            ),
        },
        takes=EACH,
        place=20,
        wire="Connect responses with the error code in PNIO status.",
        reports=(
            "The device stays failed; the diagnosis shows the connection as refused. A controller asks again and again."
        ),
    ),
)
