"""A group of drives of the farm file, and one drive of it: the keys of drives on any bus."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Self

from pydantic import Field

from pnfarm.config.axis import Load, Motor
from pnfarm.config.impairment import Impairment
from pnfarm.config.machine import Machine
from pnfarm.config.own_faults import MAX_FAULTS, OwnFault
from pnfarm.config.realism import DriveRealism, Realism
from pnfarm.config.section import DescribedSection, Section
from pnfarm.config.tasks import Task, drive_task
from pnfarm.config.values import NamePattern, Scalar

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from pnfarm.drives.description.model import Model
    from pnfarm.drives.description.parts import Fault
    from pnfarm.drives.motion_tasks import MotionTask

__all__ = ["MAX_AXES", "MAX_DRIVES", "AxisConfig", "AxisGroup", "Claim", "DriveConfig", "DriveGroup"]

#: Most drives of one farm.
MAX_DRIVES = 4094
#: Most axes of one drive: the telegrams of so many fit into a frame.
MAX_AXES = 12

#: After a drive's name.
AxisName = Annotated[str, Field(pattern=r"^[a-z0-9]([a-z0-9-]*[a-z0-9])?$", max_length=30)]

Identity = Annotated[
    dict[str, Any],
    Field(
        description="Identity of the drive where it differs from the model's. `gsdml: FILE` takes vendor, device, "
        "access point, modules, submodules and order number from the maker's own file (PROFINET), `gsd: FILE` ident "
        "number, names, telegrams and octets of Set_Prm (PROFIBUS); other keys have priority over it."
    ),
]


class DriveGroup(DescribedSection):
    """One drive, or `count` alike."""

    #: What messages call them.
    members: ClassVar[str] = "drives"

    name: NamePattern = Field(description="Station name; {n} counts, {n:02} with leading zeros.")
    count: int = Field(default=1, ge=1, le=MAX_DRIVES, description="Number of drives.")
    start: int = Field(default=1, ge=0, le=1_000_000, description="First number for {n}.")
    model: str = Field(description="Drive model, one of `pnfarm models`.", examples=["akd-profinet"])
    load: Load = Field(default_factory=Load)
    motor: Motor = Field(default_factory=Motor)
    machine: Machine = Field(default_factory=Machine)
    limits: Literal["strict", "lax"] = Field(
        default="strict",
        description="strict: refuse what the manual does not permit; lax: permit more, for load tests.",
    )
    identity: Identity = Field(default_factory=dict)
    realism: DriveRealism = Field(
        default_factory=Realism,
        description="Noise, latency, boot time, drift; `on`: all that the model has, `off`: none. Left out, those "
        "whose figure has a source (`pnfarm models MODEL`), on a real link and with strict limits; otherwise none.",
    )
    params: dict[str, Scalar] = Field(
        default_factory=dict,
        description="Parameters at power-on, by the manual's name or by number: whole numbers as on the wire; "
        "for a float parameter also a number with a decimal point.",
        examples=[{"DRV.OPMODE": 1}],
    )
    motion_tasks: list[Task] = Field(
        default_factory=list, description="Motion tasks stored in the drive, as by a commissioning tool."
    )
    behaviour: dict[str, str] = Field(
        default_factory=dict,
        description="Behaviour where the manual leaves it open, a reading for each point; `pnfarm models MODEL` "
        "and docs/behaviour.md list them.",
        examples=[{"control-by-plc": "hold"}],
    )
    words: dict[str, Annotated[list[str], Field(max_length=64)]] = Field(
        default_factory=dict,
        max_length=2,
        description="Words of the free telegram, `output` from the controller and `input` to it, by the names of the "
        "model's signals; `-` is an unused word, a double word is named once.",
        examples=[{"output": ["STW1", "NSOLL_B"], "input": ["ZSW1", "NIST_B", "MIST_GLATT"]}],
    )
    faults: list[OwnFault] = Field(
        default_factory=list,
        max_length=MAX_FAULTS,
        description="Faults and warnings in addition to the model's, which `drive-fault` and `drive-warning` raise.",
    )
    impair: list[Impairment] = Field(default_factory=list, description="Faults that are active from the start.")


class AxisGroup(Section):
    """One axis of a drive that has several; what it leaves out is as the drive has it."""

    name: AxisName = Field(description="Its name after the drive's and a dot: x in feeder.x.")
    load: Load | None = Field(default=None, description="As of the drive.")
    motor: Motor | None = Field(default=None, description="As of the drive; of the same kind.")
    machine: Machine | None = Field(default=None, description="As of the drive.")
    params: dict[str, Scalar] = Field(default_factory=dict, description="Parameters in addition to those of the drive.")
    motion_tasks: list[Task] | None = Field(default=None, description="As of the drive.")


#: A value that must be unique in a farm: key of the group, value, and the value in words.
Claim = tuple[str, object, str]


@dataclass(frozen=True, slots=True, kw_only=True)
class AxisConfig:
    """One axis of a drive that has several.

    ``name`` is the whole name, with the drive's; ``telegram`` None is the model's default, ``supplementary`` none, and
    ``slot`` None the one after the axis before.
    """

    name: str
    load: Load = field(default_factory=Load)
    motor: Motor = field(default_factory=Motor)
    machine: Machine = field(default_factory=Machine)
    params: Mapping[str, int | float | str | bool] = field(default_factory=dict)
    motion_tasks: tuple[MotionTask, ...] = ()
    telegram: int | None = None
    slot: int | None = None
    supplementary: int | None = None

    @classmethod
    def of(cls, group: AxisGroup, drive: DriveConfig, **bus: Any) -> Self:
        """An axis of a drive; ``bus``: fields that only its bus has."""
        return cls(
            name=f"{drive.name}.{group.name}",
            load=drive.load if group.load is None else group.load,
            motor=drive.motor if group.motor is None else group.motor,
            machine=drive.machine if group.machine is None else group.machine,
            params={**drive.params, **group.params},
            motion_tasks=drive.motion_tasks
            if group.motion_tasks is None
            else tuple(drive_task(task) for task in group.motion_tasks),
            **bus,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveConfig:
    """One drive as the farm file configures it; a bus's drives have more.

    ``index`` counts through the farm from 0; ``group`` is the entry of ``drives:`` that it comes from.
    ``model`` is the name under which the model is listed, also where the file has an alias; ``listed`` is that model
    with the parameters of the farm file's list, None where the file has no list for it.
    ``realism_by_source``: keys that ``realism`` leaves out are on where a source gives the model's figure.
    ``mac`` is that of its port, empty on a link without hardware addresses.  ``several``: its axes, where it has more
    than the one of its name.
    """

    index: int
    group: int
    name: str
    model: str
    load: Load
    motor: Motor
    machine: Machine
    strict: bool
    identity: Mapping[str, Any]
    params: Mapping[str, int | float | str | bool]
    impair: tuple[Impairment, ...]
    motion_tasks: tuple[MotionTask, ...] = ()
    behaviour: Mapping[str, str] = field(default_factory=dict)
    words: Mapping[str, Sequence[str]] = field(default_factory=dict)
    faults: tuple[Fault, ...] = ()
    realism: Realism = field(default_factory=Realism)
    realism_by_source: bool = False
    listed: Model | None = None
    mac: bytes = b""
    several: tuple[AxisConfig, ...] = ()

    @classmethod
    def extending(cls, common: DriveConfig, **own: Any) -> Self:
        """The drive of a bus: the fields of ``common``, and the bus's ``own``."""
        return cls(**{each.name: getattr(common, each.name) for each in fields(DriveConfig)} | own)

    @property
    def axes(self) -> tuple[AxisConfig, ...]:
        """All axes; of a drive with one, that axis has the drive's name."""
        if self.several:
            return self.several
        own = AxisConfig(
            name=self.name,
            load=self.load,
            motor=self.motor,
            machine=self.machine,
            params=self.params,
            motion_tasks=self.motion_tasks,
            **self.of_axis(),
        )
        return (own,)

    @property
    def names(self) -> tuple[str, ...]:
        """Its own, and those of several axes."""
        return (self.name, *(axis.name for axis in self.several))

    def of_axis(self) -> Mapping[str, Any]:
        """Fields of an axis that only its bus has."""
        return {}

    def claims(self) -> Sequence[Claim]:
        """Values that no other drive of the farm may have, besides its name."""
        return ()

    def addresses(self) -> Sequence[str]:
        """Its addresses on its bus, as text for a table: hardware address, address."""
        return "", ""
