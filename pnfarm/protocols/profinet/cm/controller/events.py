"""Events of a controller's AR, and the calls that it requests.

Every end of an AR is one of three events: :class:`ArFailed` before it was established, :class:`ArAborted` after,
:class:`ArReleased` after the owner's release.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from pnfarm.wire.value import value_class

if TYPE_CHECKING:
    from collections.abc import Hashable, Mapping

    from pnfarm.protocols.profinet.cm.ar import ExpectedKey, IocrLayout
    from pnfarm.protocols.profinet.cm.controller.response import ModuleDeviation
    from pnfarm.protocols.profinet.wire.alarms.notification import AlarmNotification
    from pnfarm.protocols.profinet.wire.rpc.pdu import PnioStatus

__all__ = [
    "AlarmIndicated",
    "ApplicationReadyReceived",
    "ArAborted",
    "ArEstablished",
    "ArFailed",
    "ArReleased",
    "CmctlEvent",
    "Connected",
    "ControllerCall",
    "ParametersEnded",
    "Parametrised",
    "Phase",
    "RecordRead",
    "RecordWriteDone",
    "SubmodulesChanged",
]

#: Phase of a start-up that failed.
Phase = Literal["connect", "write", "parameter-end", "application-ready"]


@value_class
class ControllerCall:
    """One RPC call to the device's interface; its end comes back through ``call_returned`` or ``call_failed``."""

    key: int
    opnum: int
    args_maximum: int
    payload: bytes


@dataclass(frozen=True, slots=True)
class Connected:
    """The device accepted the Connect: all cyclic channels start now, with the frame ids as the device answered.

    ``layouts``: the input CRs', then the output CRs'.
    """

    layouts: tuple[IocrLayout, ...]
    device_mac: bytes
    module_diff: tuple[ModuleDeviation, ...]


@dataclass(frozen=True, slots=True)
class Parametrised:
    """The device confirmed PrmEnd; ApplicationReady is awaited."""


@dataclass(frozen=True, slots=True)
class ApplicationReadyReceived:
    """The device is ready, or ready again after a plug (``after_plug``)."""

    module_diff: tuple[ModuleDeviation, ...]
    after_plug: bool = False


@dataclass(frozen=True, slots=True)
class ArEstablished:
    """ApplicationReady was answered: outputs are valid from now on."""


@dataclass(frozen=True, slots=True)
class AlarmIndicated:
    """The device raised an alarm, and it has been acknowledged; ``text`` says it in one line."""

    alarm: AlarmNotification
    text: str


@dataclass(frozen=True, slots=True)
class SubmodulesChanged:
    """Which submodules cannot be used from now on, and why; the controller's own data for them are to be BAD."""

    unusable: Mapping[ExpectedKey, str]


@dataclass(frozen=True, slots=True)
class ParametersEnded:
    """Parameters that were written while data flow: after an alarm (``after_plug``), or from PrmBegin on.

    ``reason`` is empty when the device is ready with them.  ``code`` is the RtaError that the AR ends with, None when
    it goes on.
    """

    submodules: tuple[ExpectedKey, ...]
    after_plug: bool
    reason: str = ""
    code: int | None = None


@dataclass(frozen=True, slots=True)
class ArFailed:
    """The AR was not established.  ``status`` is the device's, if the device refused."""

    phase: Phase
    status: PnioStatus | None
    reason: str


@dataclass(frozen=True, slots=True)
class ArAborted:
    """An established AR ended.

    The two codes are those of the RTA error that was sent or received; ``error_code1`` is RTA_ERR_CLS_PROTOCOL unless
    the device says otherwise, ``error_code2`` then one of ``errors.RtaError``.
    """

    by_device: bool
    error_code1: int
    error_code2: int
    reason: str


@dataclass(frozen=True, slots=True)
class ArReleased:
    """The owner's release is through; ``reason`` is empty when the device confirmed it."""

    reason: str = ""


@dataclass(frozen=True, slots=True)
class RecordRead:
    """The end of a read: ``data``, or the device's ``status``, or a ``reason`` why there is neither."""

    tag: Hashable
    data: bytes | None
    status: PnioStatus | None = None
    reason: str = ""


@dataclass(frozen=True, slots=True)
class RecordWriteDone:
    """The end of a write.  ``tag`` of a parameter record is the plan's ParameterRecord itself.

    ``status`` is the device's, None when no usable answer came; then ``reason`` says why.
    """

    tag: Hashable
    status: PnioStatus | None
    reason: str = ""

    @property
    def ok(self) -> bool:
        return self.status is not None and self.status.ok


CmctlEvent = (
    Connected
    | AlarmIndicated
    | Parametrised
    | ApplicationReadyReceived
    | ArEstablished
    | ArFailed
    | ArAborted
    | ArReleased
    | RecordRead
    | RecordWriteDone
    | SubmodulesChanged
    | ParametersEnded
)
