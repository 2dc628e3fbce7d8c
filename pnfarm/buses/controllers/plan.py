"""From the farm file to a controller's plan: what is the same on several buses."""

from __future__ import annotations

from contextlib import contextmanager
from ipaddress import IPv4Interface
from typing import TYPE_CHECKING, Any

from pnfarm.buses.controllers.axis_program import axis_program
from pnfarm.drives.telegrams.signal_view import axis_signals
from pnfarm.drives.telegrams.telegram import NO_TELEGRAM
from pnfarm.errors import ConfigError, DecodeError
from pnfarm.table.axis_codes import OBJECT_AXIS, TASKS_NONE

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from pathlib import Path

    from pnfarm.buses.controllers.signal_steps import KnownSteps
    from pnfarm.config.controller import ControllerSection
    from pnfarm.config.drive import DriveConfig
    from pnfarm.drives.description.model import Model
    from pnfarm.drives.telegrams.telegram import Telegram

__all__ = ["describing", "own_address", "profidrive_keys", "reconnect_after_ns", "supplement_of", "telegram_of"]


def reconnect_after_ns(section: ControllerSection) -> int | None:
    """The pause after a lost connection; None for one that stays lost."""
    return section.reconnect.after_ns if section.reconnect is not None else None


def own_address(given: IPv4Interface | None, others: Iterable[IPv4Interface | None]) -> IPv4Interface:
    """The controller's address; a free one next to those of drives and devices where the file gives none.

    Raises :class:`ConfigError`.
    """
    if given is not None:
        return given
    known = [ip for ip in others if ip is not None]
    if not known:
        raise ConfigError("neither the controller nor a drive has an ip; give `controller: {ip: 10.77.0.1/24}`")
    network, taken = known[0].network, {ip.ip for ip in known}
    for address in network.hosts():
        if address not in taken:
            return IPv4Interface((address, network.prefixlen))
    raise ConfigError(f"{network} has no address left for the controller; give it one outside of the drives'")


def supplement_of(model: Model, number: int | None) -> Telegram:
    """A drive's supplementary telegram, one without words for None.  Raises :class:`ConfigError` as the others do."""
    found = NO_TELEGRAM if number is None else model.profidrive.supplements.get(number)
    if found is None:
        known = ", ".join(map(str, model.profidrive.supplements)) or "none"
        raise ConfigError(f"{model.name} has no supplementary telegram {number}; it has {known}")
    return found


def telegram_of(model: Model, number: int | None) -> Telegram:
    """A drive's telegram, its usual one for None.  Raises :class:`ConfigError` for one that the model does not have."""
    telegram = model.profidrive.telegrams.get(model.profidrive.default_telegram if number is None else number)
    if telegram is None:
        known = ", ".join(map(str, model.profidrive.telegrams))
        raise ConfigError(f"{model.name} has no telegram {number}; it has {known}")
    return telegram


def profidrive_keys(
    section: ControllerSection,
    drive: DriveConfig,
    model: Model,
    number: int,
    known_steps: KnownSteps,
    supplementary: int | None = None,
) -> dict[str, Any]:
    """What any plan has of a PROFIdrive drive with these telegrams, by the fields of ``PlannedDevice``.

    Raises :class:`ConfigError` as :func:`telegram_of` does, and for a program that the telegram has no signals for.
    """
    telegram, steps = telegram_of(model, number), known_steps.of(model, drive, number)
    beside = supplement_of(model, supplementary)
    words = telegram.output + beside.output, telegram.input + beside.input
    if section.program.kind == "positions" and steps.task_form == TASKS_NONE and steps.object == OBJECT_AXIS:
        raise ConfigError(f"drive {drive.name}: telegram {number} of {model.name} has no signal of a position task")
    return {
        "name": drive.name,
        "model": model.name,
        "program": axis_program(section.program),
        "steps": steps,
        "signals": axis_signals(model.profidrive, number, steps.units(), words),
        "output_words": telegram.output_words + beside.output_words,
        "input_words": telegram.input_words + beside.input_words,
        "described": model,
        "reconnect_after_ns": reconnect_after_ns(section),
    }


@contextmanager
def describing(device: str, path: Path | None = None, *, slugs: bool = False) -> Iterator[None]:
    """Read a device's description file in the block: what goes wrong is a :class:`ConfigError` with their names.

    ``path``: None where the file has been read.  ``slugs``: also with the slug of what cannot be read.
    """
    where = "" if path is None else f", {path}"
    try:
        yield
    except OSError as exc:
        raise ConfigError(f"device {device}{where}: cannot be read: {(exc.strerror or str(exc)).lower()}") from exc
    except DecodeError as exc:
        raise ConfigError(f"device {device}{where}: {exc if slugs else exc.detail or exc.reason}") from exc
    except ConfigError as exc:
        # the loader of a file names it itself
        raise ConfigError(f"device {device}{'' if str(path) in str(exc) else where}: {exc}") from exc
