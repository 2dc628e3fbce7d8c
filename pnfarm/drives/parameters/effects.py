"""The effect of each parameter: whether it acts, reads a state of the drive, or is only stored.

It follows from the parameter's backing and from the model's sections that name parameters; exceptions are in the
section ``effects``, with the reason.  A parameter for another motor than the present one (``motor`` in its row) has
the effect that it has with its own motor.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.drives.description.parts import Effect
from pnfarm.drives.parameters.computed import CONSTANT_COMPUTED
from pnfarm.drives.parameters.parameter import Backing
from pnfarm.errors import ConfigError
from pnfarm.firmware.axis import AXIS

if TYPE_CHECKING:
    from pnfarm.drives.description.model import Model
    from pnfarm.drives.description.sections import Section
    from pnfarm.drives.parameters.parameter import Parameter

__all__ = ["EFFECTS", "effect_of", "read_effects"]


#: Each effect as a sentence, for tables and help.
EFFECTS = {
    Effect.ACTS.value: "writing it, or its value, changes what the drive does",
    Effect.LIVE.value: "it reads what the drive is or does",
    Effect.KEPT.value: "it is stored and read back, without effect",
    Effect.CONSTANT.value: "it always reads the same",
}


def _acting_parameters(model: Model) -> frozenset[int]:
    """The PNUs of stored parameters that act because the model's sections name them."""
    numbers: set[int] = {model.communication_loss.action_parameter, model.communication_loss.stop_parameter}
    numbers.update(model.access.mapping_elements, (entry.pnu for entry in model.consequences), model.fault_actions)
    if model.motion_tasks is not None:
        numbers.update((model.motion_tasks.number, *model.motion_tasks.contents))
    if model.diagnosis_coding is not None:
        numbers.add(model.diagnosis_coding.mode_parameter)
    for group in (model.position_units, model.factor_group, model.control_limits):
        if group is not None:
            numbers |= group.numbers
    return frozenset(numbers)


def effect_of(model: Model, parameter: Parameter) -> Effect:
    return model.effects.get(parameter.pnu) or _derived(model, model.canonical(parameter))


def _derived(model: Model, parameter: Parameter) -> Effect:
    match parameter.backing:
        case Backing.COMMAND:
            # a command that is always refused reads as zero
            return Effect.CONSTANT if parameter.argument == "refuse" else Effect.ACTS
        case Backing.SIGNAL:
            return Effect.ACTS if parameter.argument == "received" else Effect.LIVE
        case Backing.COMPUTED:
            if parameter.writable:
                return Effect.ACTS
            return Effect.CONSTANT if parameter.argument in CONSTANT_COMPUTED else Effect.LIVE
        case Backing.FIELD:
            if parameter.writable:
                return Effect.ACTS
            return Effect.LIVE if AXIS.fields[parameter.argument].writer in {"firmware", "fault"} else Effect.CONSTANT
        case _:
            if not parameter.writable:
                return Effect.CONSTANT
            return Effect.ACTS if parameter.pnu in _acting_parameters(model) else Effect.KEPT


# the section


def read_effects(model: Model, section: Section) -> dict[int, Effect]:
    """The section ``effects``: PNU -> effect that differs from the derived one; raises :class:`ConfigError`."""
    found: dict[int, Effect] = {}
    for key, fact in section.items():
        pnu = int(key)
        if pnu not in model.parameters:
            raise section.wrong(key, f"there is no parameter {pnu}")
        try:
            effect = Effect(fact.value)
        except ValueError:
            known = ", ".join(each.value for each in Effect)
            raise section.wrong(key, f"{fact.value!r} is not one of {known}") from None
        if effect is _derived(model, model.canonical(model.parameters[pnu])) or not fact.note:
            raise ConfigError(
                f"{section.where(key)}: its row gives the same effect without this entry, or the reason is missing"
            )
        found[pnu] = effect
    return found
