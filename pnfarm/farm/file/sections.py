"""The farm file as types: every key with its unit, its default and its bounds.

Single values are defined here, in :mod:`pnfarm.config` and with the buses; values are checked against each other in
:mod:`pnfarm.farm.file.checks`.  Keys are the file's; where a value is converted to a plain number, the attribute's name
has the unit (``cycle`` -> ``cycle_ns``).
"""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import (
    AfterValidator,
    BeforeValidator,
    Field,
    ModelWrapValidatorHandler,
    SerializeAsAny,
    ValidationError,
    ValidationInfo,
    WrapValidator,
    field_validator,
)
from pydantic_core import InitErrorDetails

from pnfarm.buses.devices import devices_part
from pnfarm.config.controller import ControllerSection
from pnfarm.config.device import DeviceGroup
from pnfarm.config.drive import DriveGroup
from pnfarm.config.known import catalogue
from pnfarm.config.links import Link
from pnfarm.config.opcua import DEFAULT_OPCUA_LISTEN, OpcUa, open_opcua
from pnfarm.config.plant import PlantSection
from pnfarm.config.section import Section
from pnfarm.config.values import OFF, Duration, FarmName, Listen, file_key, is_loopback, secret_key
from pnfarm.farm.file.choice import Choice
from pnfarm.farm.lease import DEFAULT_TTL_NS, LONGEST_TTL_NS, SHORTEST_TTL_NS
from pnfarm.vocabulary.problem import Problem

__all__ = ["CHOICE", "DEFAULT_LISTEN", "Api", "FarmSections", "Lease", "Realtime"]

#: Key of the validation context: which bus's sections are meant.
CHOICE = "choice"

#: Default address of the API.
DEFAULT_LISTEN = "127.0.0.1:8702"


class Api(Section):
    """Where the HTTP API, the metrics and the web page are served."""

    listen: Listen = Field(description="HOST:PORT; port 0 takes any free one.")
    token: str | None = secret_key(
        "Bearer token that clients must send; left out, one is generated unless the API listens on loopback only."
    )
    token_file: str | None = file_key(
        "File of the token, relative to this file: made at the first start where there is none, and holds "
        "`token` where that is given. Left out, api-token in the folder of `state`, for a port beyond loopback."
    )
    read_token: str | None = secret_key(
        "Further bearer token, which may read and change nothing; with it, every client needs a token."
    )
    tokens: str | None = file_key(
        "File of further tokens with roles and times to expire (`pnfarm token`), relative to this file; "
        "with it, every client needs a token, and none is generated."
    )
    audit: str | None = file_key(
        "File that gets a line for each request that changes something, relative to this file (`pnfarm audit`)."
    )
    tls_cert: str | None = file_key(
        "Certificate in PEM, with its chain, relative to this file: the API and the page are served by TLS "
        "(https). A changed file is read again."
    )
    tls_key: str | None = file_key(
        "The certificate's key in PEM without a passphrase, relative to this file; left out, it is in the "
        "certificate's file."
    )

    @field_validator("tls_key")
    @classmethod
    def _belongs(cls, tls_key: str | None, info: ValidationInfo) -> str | None:
        if tls_key is not None and info.data.get("tls_cert") is None:
            raise Problem("is a key without a certificate", "tls_cert beside it")
        return tls_key

    @field_validator("token", "read_token")
    @classmethod
    def _can_be_sent(cls, token: str | None) -> str | None:
        if token is not None and not all("!" <= letter <= "~" for letter in token):
            raise Problem("has characters that no header can carry", "letters, digits and signs of ASCII, no blanks")
        return token

    @field_validator("read_token")
    @classmethod
    def _reads_only(cls, read_token: str | None, info: ValidationInfo) -> str | None:
        if read_token is not None and read_token == info.data.get("token"):
            raise Problem("is the same as token, which may change everything", "another token")
        return read_token

    @property
    def needs_token(self) -> bool:
        """Whether clients must show a token: beyond loopback, or where tokens differ in what they may do."""
        return not self.is_loopback or self.read_token is not None or self.tokens is not None

    @property
    def host(self) -> str:
        """The address to bind to."""
        return self.listen[0]

    @property
    def port(self) -> int:
        """The TCP port, 0 for any free one."""
        return self.listen[1]

    @property
    def is_loopback(self) -> bool:
        """Whether only this machine can reach it."""
        return is_loopback(self.host)


def _within_ttl(value: int) -> int:
    if not SHORTEST_TTL_NS <= value <= LONGEST_TTL_NS:
        raise Problem(f"is {value / 1e9:g} s", f"{SHORTEST_TTL_NS // 10**9} s to {LONGEST_TTL_NS // 10**9} s")
    return value


def _open_api(value: Any) -> Any:
    """The short forms: ``off``, and an address alone."""
    if value is False or value == OFF:
        return None
    if isinstance(value, (dict, Api)):
        return value
    return {"listen": value}


class Realtime(Section):
    """How the cyclic engine's thread runs.  `pnfarm doctor` shows what this machine permits."""

    cpu: int | None = Field(default=None, ge=0, le=4095, description="CPU to run on; left out, any.")
    fifo: int = Field(
        default=1,
        ge=0,
        le=99,
        description="SCHED_FIFO priority of the engine's thread, where the system permits it; 0 for the ordinary "
        "scheduler.",
    )
    nice: int | None = Field(
        default=-11,
        ge=-20,
        le=19,
        description="Niceness of the engine's thread with `fifo: 0`, or where the system refuses SCHED_FIFO; it may "
        "refuse this, too.",
    )
    mlockall: bool = Field(default=False, description="Lock all memory in RAM.")
    timestamps: bool = Field(
        default=True,
        description="Whether a frame's time is the kernel's stamp, so that the controller's intervals are exact; "
        "otherwise it is that of the engine's next tick.",
    )
    timer_slack_ns: int = Field(
        default=1, ge=1, le=1_000_000_000, description="Timer slack of the engine's thread, nanoseconds."
    )


class Lease(Section):
    """The right to run the drives, held in the database of `state`: no drive runs twice."""

    ttl_ns: Annotated[Duration, AfterValidator(_within_ttl)] = Field(
        default=DEFAULT_TTL_NS,
        alias="ttl",
        description="Time without a renewal after which another process may run the drives; the drives here are mute a "
        "fifth of it earlier. It is renewed each second, more often if it is short.",
    )


def _choice(info: ValidationInfo) -> Choice:
    found = (info.context or {}).get(CHOICE)
    return found if isinstance(found, Choice) else Choice({}, catalogue())


def _read_group(value: Any, _: ModelWrapValidatorHandler[DriveGroup], info: ValidationInfo) -> DriveGroup:
    """A group by the keys of its model's bus."""
    if isinstance(value, DriveGroup):
        return value
    section: type[DriveGroup] = _choice(info).group(value).farm_file.drives
    return section.model_validate(value, context=info.context)


def _read_devices(value: Any, _: ModelWrapValidatorHandler[DeviceGroup], info: ValidationInfo) -> DeviceGroup:
    """A group of devices by the keys of its bus."""
    if isinstance(value, DeviceGroup):
        return value
    section: type[DeviceGroup] = devices_part(_choice(info).devices(value)).devices
    return section.model_validate(value, context=info.context)


def _read_controllers(
    value: Any, _: ModelWrapValidatorHandler[tuple[ControllerSection, ...]], info: ValidationInfo
) -> tuple[ControllerSection, ...]:
    """The controllers of a section, each by the keys of its bus; errors are where the file has the value."""
    if value is None:
        return ()
    if isinstance(value, tuple):
        return value
    choice = _choice(info)
    wrong = [
        InitErrorDetails(type="value_error", loc=place, input=value, ctx={"error": Problem(what, allowed)})
        for place, what, allowed in choice.misplaced(value)
    ]
    found: list[ControllerSection] = []
    for one in choice.controllers(value):
        try:
            section = one.section.model_validate(one.values, context=info.context)
        except ValidationError as error:
            for each in error.errors(include_url=False):
                details = InitErrorDetails(type=each["type"], loc=one.at(each["loc"]), input=each["input"])
                if "ctx" in each:
                    details["ctx"] = each["ctx"]
                wrong.append(details)
        else:
            found.append(section.placed(one.bus.name, one.in_map))
    if wrong:
        raise ValidationError.from_exception_data("controller", wrong)
    return tuple(found)


ParameterLists = dict[str, Annotated[str, Field(min_length=1, max_length=4096)]]
AnyGroup = Annotated[SerializeAsAny[DriveGroup], WrapValidator(_read_group)]
AnyDevices = Annotated[SerializeAsAny[DeviceGroup], WrapValidator(_read_devices)]
AnyControllers = Annotated[tuple[SerializeAsAny[ControllerSection], ...], WrapValidator(_read_controllers)]


class FarmSections(Section):
    """A farm file; or, without `farm` and `link`, what the built-in controller needs to run foreign devices."""

    farm: FarmName | None = Field(default=None, description="The farm's name.", examples=["line-1"])
    link: Link | None = Field(default=None, description="What the drives are attached to.")
    state: str | None = Field(
        default=None,
        min_length=1,
        description="Folder of the drives' non-volatile memory, relative to this file, or a database: "
        "`postgresql://USER@HOST/DATABASE`, where a password may also come from PGPASSFILE or `?passfile=`; left out, "
        "nothing is kept.",
        examples=["./state", "postgresql://farm@db.example/pnfarm"],
    )
    lease: Lease = Field(default_factory=Lease)
    api: Annotated[Api | None, BeforeValidator(_open_api)] = Field(
        default_factory=lambda: Api.model_validate({"listen": DEFAULT_LISTEN}),
        description="Address of the HTTP API, HOST:PORT; `off` for no API.",
        examples=[DEFAULT_LISTEN, OFF],
    )
    opcua: Annotated[OpcUa | None, BeforeValidator(open_opcua)] = Field(
        default=None,
        description="Address of the OPC UA server, HOST:PORT, or a map; `on` for the usual one. "
        "Needs `pip install 'pnfarm[opcua]'`.",
        examples=[DEFAULT_OPCUA_LISTEN, OFF],
    )
    realtime: Realtime = Field(default_factory=Realtime)
    lldp: bool = Field(default=True, description="Whether the drives and the controller send LLDP to their neighbours.")
    parameter_lists: ParameterLists = Field(
        default_factory=dict,
        description="Parameters that a model's manual does not describe, for all drives of the model: model: CSV file, "
        "relative to this file. The drives keep them without effect.",
        examples=[{"hiwin-e1": "e1-parameters.csv"}],
    )
    drives: list[AnyGroup] = Field(
        default_factory=list,
        min_length=1,
        description="The groups of drives; may be left out only if the file or the controller has `devices`.",
    )
    devices: list[AnyDevices] = Field(
        default_factory=list,
        min_length=1,
        description="The groups of devices that are no drives, each by its maker's file.",
    )
    plant: PlantSection | None = Field(
        default=None, description="What is behind the stations: models, and wires between their ports and signals."
    )
    #: One for each bus, in the order of their first drives.
    controllers: AnyControllers = Field(
        default=(), alias="controller", description="The built-in controller, for `pnfarm plc`."
    )

    @property
    def controller(self) -> ControllerSection | None:
        """The only controller, or the first; None where there is none."""
        return self.controllers[0] if self.controllers else None
