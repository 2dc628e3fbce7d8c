"""Names that a farm file may use: drive models and fault kinds, as far as the checks need them.

The checks take this as an argument, so that they do not depend on installed models; :func:`catalogue` has
the models of :mod:`pnfarm.drives.catalogue`.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cache, lru_cache
from operator import attrgetter
from typing import TYPE_CHECKING, Any, cast

from pnfarm.config.axis import axis_complaints
from pnfarm.config.realism import missing_figures
from pnfarm.drives import catalogue as drives
from pnfarm.drives.description.behaviour_sets import SET
from pnfarm.drives.description.identity import OVERRIDES, overrides_of, with_identity
from pnfarm.drives.description.motor_kinds import ROTARY, with_motor
from pnfarm.drives.parameters.given_values import raw_number
from pnfarm.drives.parameters.parameter import Form, ParameterError
from pnfarm.drives.parameters.user_list import read_parameter_list
from pnfarm.drives.telegrams.own_words import with_words
from pnfarm.errors import ConfigError
from pnfarm.firmware.axis import AXIS
from pnfarm.vocabulary.quoting import did_you_mean, shown

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Hashable, Mapping, Sequence

    from pnfarm.config.axis import Load, Motor
    from pnfarm.config.realism import Realism
    from pnfarm.drives.description.model import Model
    from pnfarm.drives.parameters.user_list import ListProblem

__all__ = ["Complaint", "Known", "ModelFacts", "catalogue"]

#: What is wrong with one key below a section, and what is allowed: ``("vendor", "is 70000", "...")``.
Complaint = tuple[str, str, str]


@lru_cache(maxsize=64)
def _axes(model: Model, kind: str | None, pitch: float | None) -> tuple[Any, float]:
    """A table of one axis with this motor, to be copied, and mm per revolution: most groups have the same."""
    driven = with_motor(model, kind, pitch)
    axes = AXIS.allocate(1)
    driven.apply_motor(axes[0])
    return axes, driven.pitch


@dataclass(frozen=True, slots=True)
class ModelFacts:
    """A drive model of the catalogue as the checks of the farm file see it."""

    model: Model

    name = property(attrgetter("model.name"))
    bus = property(attrgetter("model.bus"))
    min_cycle_ns = property(attrgetter("model.limits.min_cycle_ns"))
    #: 0 where its manual names none.
    max_cycle_ns = property(attrgetter("model.limits.max_cycle_ns"))
    send_clocks = property(attrgetter("model.limits.send_clocks"))
    telegrams = property(attrgetter("model.profidrive.telegrams"))
    supplements = property(attrgetter("model.profidrive.supplements"))
    motion_tasks = property(attrgetter("model.limits.motion_tasks"))
    most_axes = property(attrgetter("model.limits.axes"))
    aliases = property(attrgetter("model.aliases"))
    described = property(attrgetter("model"))

    @property
    def open_points(self) -> Mapping[str, Sequence[str]]:
        """Points that its manual leaves open, and the readings of each, the default first."""
        sets = {SET: sorted(self.model.behaviour_sets, key=lambda name: name != "generic")}
        return (sets if self.model.behaviour_sets else {}) | {
            point.name: sorted(point.readings, key=lambda name: name != point.default) for point in self.model.behaviour
        }

    def parameter_complaints(self, params: Mapping[str, Any]) -> list[Complaint]:
        """What is wrong with the ``params`` of a group."""
        complaints: list[Complaint] = []
        for key, value in params.items():
            try:
                parameter, _ = self.model.resolve(key)
            except ParameterError:
                hint = did_you_mean(key, self.model.parameter_names)
                what = f"{self.name} has no such parameter{hint}"
                complaints.append((key, what, f"a name or number of `pnfarm models {self.name}`"))
                continue
            if not self.model.writable(key):
                complaints.append((key, f"{parameter.name} can only be read", "a parameter that can be written"))
                continue
            raw = raw_number(parameter, value)
            if raw is None or not parameter.allows(raw):
                allowed = f"a whole number from {parameter.minimum} to {parameter.maximum}"
                if parameter.form is Form.FLOAT:
                    allowed = f"a number such as 50.0, or its bits: {allowed}"
                complaints.append((key, f"is {shown(value)}", allowed))
        return complaints

    def identity_complaints(self, identity: Mapping[str, Any]) -> list[Complaint]:
        """What is wrong with the ``identity`` of a group."""
        allowed = f"what `pnfarm models {self.name}` shows under identity, dap and telegrams"
        if (known := overrides_of(self.model)) is not OVERRIDES:
            allowed = "; ".join(f"{key}: {what}" for key, what in known.items())
        complaints: list[Complaint] = []
        # each key alone, so that every wrong one is named
        for key, value in identity.items():
            if (wrong := self._identity_error({key: value})) is not None:
                complaints.append((key, wrong, allowed))
        if not complaints and (wrong := self._identity_error(identity)) is not None:
            complaints.append(("", wrong, allowed))
        return complaints

    def behaviour_complaints(self, behaviour: Mapping[str, str]) -> list[Complaint]:
        """What is wrong with the ``behaviour`` of a group."""
        points = {point.name: point for point in self.model.behaviour}
        complaints: list[Complaint] = []
        for name, reading in behaviour.items():
            if name == SET:
                if reading not in self.model.behaviour_sets:
                    known = self.model.behaviour_sets
                    what = f"{self.name} has no set {shown(reading)}{did_you_mean(reading, known)}"
                    complaints.append((name, what, ", ".join(known) or "none"))
            elif name not in points:
                what = f"is not an open point of {self.name}{did_you_mean(name, points)}"
                complaints.append((name, what, ", ".join(points) or "none"))
            elif reading not in points[name].readings:
                what = f"has no reading {shown(reading)}{did_you_mean(reading, points[name].readings)}"
                complaints.append((name, what, ", ".join(points[name].readings)))
        return complaints

    def words_complaints(self, words: Mapping[str, Sequence[str]]) -> list[Complaint]:
        """What is wrong with the ``words`` of a group."""
        try:
            with_words(self.model, words)
        except ConfigError as error:
            place, _, what = str(error).partition(": ")
            return [(place.removeprefix("words").removeprefix("."), what, f"signals of `pnfarm models {self.name}`")]
        return []

    def motor_complaints(self, kind: str | None, pitch: float | None) -> list[Complaint]:
        """What is wrong with the kind and the pitch of a group's ``motor``."""
        kinds = (ROTARY, *self.model.motor_kinds)
        if kind is not None and kind not in kinds:
            hint = did_you_mean(kind, kinds)
            return [("kind", f"{self.name} has no motor {shown(kind)}{hint}", ", ".join(kinds))]
        if pitch is not None and (kind in {None, ROTARY} or self.model.motor_kinds[str(kind)].pitch <= 0.0):
            return [("pitch", "is that of a motor that turns", "a pitch for a linear motor only")]
        return []

    def moves_straight(self, kind: str | None) -> bool:
        """Whether a motor of this kind is a linear one."""
        found = self.model.motor_kinds.get(kind or ROTARY)
        return found is not None and found.pitch > 0.0

    def axis_complaints(self, load: Load, motor: Motor) -> list[Complaint]:
        """Values that ``load`` and ``motor`` of a group make together and no axis can have."""
        if self.motor_complaints(motor.kind, motor.pitch):
            return []
        axes, pitch = _axes(self.model, motor.kind, motor.pitch)
        return axis_complaints(AXIS.copies(axes)[0], load, motor, pitch)

    def realism_complaints(self, realism: Realism) -> list[tuple[tuple[str, ...], str, str]]:
        """What is wrong with the ``realism`` of a group: keys, what, and what is allowed."""
        what = f"is on, but {self.name} has no figure for it"
        return [(place, what, "a figure, or off") for place in missing_figures(realism, self.model)]

    def with_list(self, text: str, file: str) -> tuple[ModelFacts, list[ListProblem]]:
        """The model with the parameters of a list (the text of a ``file``), and what is wrong in the list."""
        model, problems = read_parameter_list(text, self.model, file)
        return ModelFacts(model), problems

    def _identity_error(self, identity: Mapping[str, Any]) -> str | None:
        try:
            with_identity(self.model, identity)
        except ConfigError as error:
            return str(error).removeprefix("identity.").split(": ", maxsplit=1)[-1]
        return None


@dataclass(frozen=True, slots=True)
class Known:
    """The names that are known: models, a model by name or alias, and the kinds of faults.

    ``fault_kinds=None`` leaves the kinds unchecked, for callers that have no fault catalogue.  ``listed`` are
    the models to which the farm file adds a list of parameters, by name.
    """

    models: tuple[str, ...]
    find: Callable[[str], ModelFacts | None]
    fault_kinds: Collection[str] | None = None
    listed: Mapping[str, ModelFacts] = field(default_factory=dict)

    def model(self, name: str) -> ModelFacts | None:
        """The model of this name or alias, None if there is none."""
        found = self.find(name)
        return None if found is None else self.listed.get(found.name, found)


def _find(name: str) -> ModelFacts | None:
    for entry in drives.models().values():
        if name == entry.name or name in entry.aliases:
            return ModelFacts(drives.model(entry.name))
    return None


def catalogue(fault_kinds: Collection[str] | None = None) -> Known:
    """The installed drive models; a caller that has the fault catalogue passes the fault kinds."""
    return _catalogue(tuple(drives.models()), cast("Hashable", fault_kinds))


@cache
def _catalogue(models: tuple[str, ...], fault_kinds: Any) -> Known:
    return Known(models, _find, fault_kinds)
