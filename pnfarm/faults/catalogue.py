"""The catalogue of faults: every kind with its parameters, its directions, and which common fields it takes.

The same words stand in the command line, the API, scenario files and Python; ``pnfarm fault kinds`` prints this.
What a kind does is in :mod:`pnfarm.faults.frames`.

Common fields, as far as a kind takes them: ``probability`` (of each occurrence) with ``seed``; ``direction``, seen from
the drive; a start ``after`` a time or ``after_cycles`` healthy cycles of the connection; an end after ``count``
occurrences, ``for`` a time or ``cycles`` of the connection.  What an occurrence is, each kind says.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.faults.catalogue_alarms import ALARM_KINDS
from pnfarm.faults.catalogue_modules import MODULE_KINDS
from pnfarm.faults.kind import FaultKind, ParamSpec, Way, words_of
from pnfarm.faults.words import Problem, did_you_mean, shown
from pnfarm.protocols.profinet.errors import AccessError, CmrpcError, ConnectFault, RtaError

if TYPE_CHECKING:
    from collections.abc import Mapping

__all__ = ["KINDS", "FaultKind", "ParamSpec", "kind_named"]

_OCTET: dict[str, Any] = {"low": 0, "high": 255}
_FRAMES = frozenset({"probability", "seed", "count", "for", "cycles"})
_EACH = frozenset({"probability", "seed", "count", "for"})
_HELD = frozenset({"for", "cycles"})
_ALL_WAYS: tuple[Way, ...] = ("both", "in", "out")
_OUT: tuple[Way, ...] = ("out",)

_ANY_LOAD: dict[str, Any] = {"low": -1e6, "high": 1e6}

_HOLD = ParamSpec(
    "yes or no", "The cause stays: the fault cannot be acknowledged until this is cleared.", default=False
)


def _cause(name: str, doc: str, fault: str) -> FaultKind:
    return FaultKind(
        name,
        "drive",
        f"{doc}; the cause stays until this ends, then the fault can be acknowledged.",
        "the fault",
        "drive-fault",
        takes=_HELD,
        preset={"fault": fault, "hold": True},
    )


_ALL = (
    FaultKind(
        "loss",
        "frames",
        "Frames are lost at random, each for itself.",
        "a frame that is lost; `count` holds for each direction",
        "frames",
        {
            "frames": ParamSpec(
                "word",
                "Which frames: cyclic data, acyclic ones (DCP, ARP, RPC, alarms), or all.",
                default="all",
                words={"all": 0, "cyclic": 1, "acyclic": 2},
            )
        },
        directions=_ALL_WAYS,
        takes=_FRAMES,
    ),
    FaultKind(
        "silence",
        "link",
        "The drive is powered but mute: nothing that it sends arrives, cyclic or not.  It still hears.",
        "a frame that is lost; `count` holds for each direction",
        "frames",
        directions=("out", "in", "both"),
        takes=_FRAMES,
    ),
    FaultKind(
        "timeout",
        "link",
        "The drive is mute until the controller's watchdog has expired and the connection broke, then it speaks again.",
        "one broken connection; without `count` and `for` it happens once",
        "timeout",
        {
            "margin": ParamSpec(
                "duration", "Silence beyond the watchdog time; left out, two cycles of the connection.", default=None
            )
        },
        takes=_EACH,
    ),
    FaultKind(
        "link-down",
        "link",
        "The cable is pulled: no carrier, no frame in or out.",
        "pulling the cable",
        "link",
        takes=_HELD,
    ),
    FaultKind(
        "link-flap",
        "link",
        "The cable is pulled and plugged again and again.",
        "pulling the cable",
        "link",
        {
            "period": ParamSpec("duration", "From one pull to the next.", default="1s"),
            "down": ParamSpec(
                "duration", "How long the cable is out each time; left out, half the period.", default=None
            ),
        },
        takes=frozenset({"count", "for"}),
    ),
    FaultKind(
        "provider-stop",
        "cyclic",
        "The data status says that the drive's provider is in STOP.",
        "a cyclic frame that is changed",
        "frames",
        directions=_OUT,
        takes=_FRAMES,
    ),
    FaultKind(
        "data-invalid",
        "cyclic",
        "The data status says that the drive's data is not valid; controllers throw such frames away.",
        "a cyclic frame that is changed",
        "frames",
        directions=_OUT,
        takes=_FRAMES,
    ),
    FaultKind(
        "iops-bad",
        "cyclic",
        "The drive's provider status (IOPS) is BAD.  When it is GOOD again while the connection stands, the alarm "
        "'return of submodule' tells the controller.",
        "a cyclic frame that is changed",
        "iops",
        directions=_OUT,
        takes=_FRAMES,
    ),
    FaultKind(
        "ar-abort",
        "connection",
        "The drive breaks the connection off with an alarm frame (ERR-RTA-PDU, RTA_ERR_CLS_PROTOCOL).",
        "one broken connection; without `count` and `for` it happens once",
        "ar-abort",
        {
            "code": ParamSpec(
                "whole number",
                "ErrorCode2 that the controller is told.",
                default="abort-request",
                words=words_of(RtaError),
                **_OCTET,
            )
        },
        takes=_EACH,
    ),
    FaultKind(
        "connect-refuse",
        "connection",
        "The drive refuses to be connected (PNIOStatus DB 81 and two codes).",
        "a Connect request that is refused",
        "connect-refuse",
        {
            "code1": ParamSpec(
                "whole number",
                "ErrorCode1: the block or machine.",
                default="cmrpc",
                words=words_of(ConnectFault),
                **_OCTET,
            ),
            "code2": ParamSpec(
                "whole number",
                "ErrorCode2; the words are those of CMRPC.",
                default="out-of-ar-resources",
                words=words_of(CmrpcError),
                **_OCTET,
            ),
        },
        takes=_EACH,
    ),
    FaultKind(
        "no-application-ready",
        "connection",
        "After parametrisation the drive never says that its application is ready.",
        "a connection whose ApplicationReady is withheld",
        "ready",
        takes=_EACH,
        preset={"delay": None},
    ),
    FaultKind(
        "late-application-ready",
        "connection",
        "After parametrisation the drive says late that its application is ready.",
        "a connection whose ApplicationReady is late",
        "ready",
        {"delay": ParamSpec("duration", "From the end of parametrisation to ApplicationReady.", default="5s")},
        takes=_EACH,
    ),
    FaultKind(
        "rpc-silence",
        "connection",
        "Connect, parameter and control calls (RPC over UDP) are lost; cyclic data and DCP go on.",
        "a datagram that is lost; `count` holds for each direction",
        "frames",
        directions=_ALL_WAYS,
        takes=_EACH,
    ),
    FaultKind(
        "dcp-silence",
        "connection",
        "The drive neither hears nor answers DCP: it is not found, named or addressed.",
        "a DCP frame that is lost; `count` holds for each direction",
        "frames",
        directions=_ALL_WAYS,
        takes=_EACH,
    ),
    FaultKind(
        "record-error",
        "records",
        "The drive's own records (parameter access) are refused (PNIOStatus DE or DF 80 and two codes).",
        "a record access that is refused",
        "record-error",
        {
            "code": ParamSpec(
                "whole number", "ErrorCode1.", default="module-failure", words=words_of(AccessError), **_OCTET
            ),
            "code2": ParamSpec("whole number", "ErrorCode2.", default=0, **_OCTET),
        },
        takes=frozenset({"count", "for"}),
    ),
    FaultKind(
        "parameter-busy",
        "records",
        "The drive still works on a parameter request: reading the response meets a state conflict (B5).",
        "a response that is held back",
        "parameter-busy",
        takes=_EACH,
    ),
    FaultKind(
        "drive-fault",
        "drive",
        "The drive has a fault: ZSW1.3, its reaction, its entry in the fault buffer.  With `for` or `cycles` its cause "
        "stays so long.",
        "the fault; with `count` it comes again once it was acknowledged",
        "drive-fault",
        {"fault": ParamSpec("fault", "Which fault.", required=True), "hold": _HOLD},
        takes=frozenset({"count", "for", "cycles"}),
    ),
    FaultKind(
        "f702",
        "drive",
        "Fieldbus communication lost: drive-fault 702.",
        "the fault; with `count` it comes again once it was acknowledged",
        "drive-fault",
        {"hold": _HOLD},
        takes=frozenset({"count", "for", "cycles"}),
        preset={"fault": 702},
    ),
    FaultKind(
        "drive-warning",
        "drive",
        "The drive has a warning: ZSW1.7.",
        "the warning",
        "drive-warning",
        {"warning": ParamSpec("fault", "Which warning.", required=True)},
        takes=_HELD,
    ),
    _cause("undervoltage", "The power supply is too low", "undervoltage"),
    _cause("encoder-error", "The feedback of the motor is lost", "encoder-error"),
    _cause("following-error", "The axis does not follow", "following-error"),
    _cause("sto", "Safe torque off is requested", "sto"),
    FaultKind(
        "limit-switch",
        "drive",
        "The axis stands on a limit of its travel: no task goes further that way, and the drive warns if its manual "
        "names a warning.",
        "reaching the limit",
        "limit-switch",
        {
            "side": ParamSpec(
                "word", "Which end of the travel.", default="positive", words={"positive": 0, "negative": 1}
            )
        },
        takes=_HELD,
    ),
    FaultKind(
        "load",
        "drive",
        "The machine puts more on the shaft, beside the load of the farm file; several of these add up.  The drive's "
        "controllers stay tuned for the load that they know.",
        "the change",
        "load",
        {
            "torque": ParamSpec("number", "Against forward motion.", default=0.0, unit="N m", **_ANY_LOAD),
            "inertia": ParamSpec("number", "More of it.", default=0.0, unit="kg m^2", low=0.0, high=1e6),
            "friction": ParamSpec("number", "More dry friction.", default=0.0, unit="N m", low=0.0, high=1e9),
        },
        takes=_HELD,
    ),
    FaultKind(
        "stuck-axis",
        "drive",
        "The machine is jammed: no torque of the motor turns the shaft.",
        "the jam",
        "load",
        takes=_HELD,
        preset={"torque": 0.0, "inertia": 0.0, "friction": 1e9},
    ),
    FaultKind(
        "not-ready",
        "drive",
        "Something that the drive needs is taken away, and nothing is broken: it coasts, and cannot be switched on "
        "before this ends.",
        "taking it away",
        "not-ready",
        {
            "missing": ParamSpec(
                "word",
                "The hardware enable (ENPO of a Moog MSD, DRV.HWENABLE of an AKD), or the power supply of the DC link.",
                default="enable",
                words={"enable": 0, "supply": 1},
            )
        },
        takes=_HELD,
    ),
    FaultKind(
        "digital-input",
        "drive",
        "A digital input of the drive is on: a switch, a touch probe.",
        "switching it on",
        "digital-input",
        {"input": ParamSpec("whole number", "Which one, from 0.", required=True, low=0, high=31)},
        takes=_HELD,
    ),
    FaultKind(
        "power-cycle",
        "drive",
        "The control supply goes off and comes back; the drive boots with what its memory kept.",
        "one interruption; with `count` the next one follows when the drive is connected again",
        "power-cycle",
        {"off": ParamSpec("duration", "How long the supply is off.", default="1s")},
        takes=frozenset({"count"}),
    ),
)

_FAMILIES = ("frames", "link", "cyclic", "liveness", "connection", "records", "alarms", "drive")

#: Every kind by name, family by family.
KINDS: Mapping[str, FaultKind] = {
    kind.name: kind
    for kind in sorted((*_ALL, *MODULE_KINDS, *ALARM_KINDS), key=lambda kind: _FAMILIES.index(kind.family))
}


def kind_named(name: object) -> FaultKind:
    """The kind of this name; raises :class:`Problem` with what may have been meant."""
    kind = KINDS.get(name) if isinstance(name, str) else None
    if kind is None:
        hint = did_you_mean(name, KINDS) if isinstance(name, str) else ""
        raise Problem(f"{shown(name)} is no kind of fault{hint}", "a kind of `pnfarm fault kinds`: " + ", ".join(KINDS))
    return kind
