"""One drive as Python code sees it: readings in the manual's terms, parameters and signals by name."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.drives.description.parts import fault_label
from pnfarm.drives.telegrams.signal_view import Inputs, SignalForm, Word, axis_signals, signal_units
from pnfarm.drives.telegrams.word_bits import STW1_BITS, ZSW1_BITS
from pnfarm.errors import ConfigError
from pnfarm.farm.views.snapshot import drive_snapshot, state_word
from pnfarm.table.axis_codes import NUMBER_MASK
from pnfarm.table.signals import STW1, ZSW1

if TYPE_CHECKING:
    from collections.abc import Callable

    from pnfarm.drives.description.model import Model
    from pnfarm.drives.telegrams.signal_view import AxisSignals
    from pnfarm.farm.core import FarmCore
    from pnfarm.station.axis import Axis
    from pnfarm.station.event_log import LogEntry

__all__ = ["DriveReadings", "FaultReading"]


class FaultReading:
    """A fault of a drive; equals its number (702, ``"32-1"``), code (``"AL.FB1"``), name and cause in the model.

    ``number`` as the manual writes it (an int, or ``"32-1"``), ``name`` the manual's, or that of a farm elsewhere,
    whose file may name faults of its own.
    """

    def __init__(self, model: Model, code: int, name: str | None = None) -> None:
        known = model.faults.get(code)
        self._model = model
        label = fault_label(code)
        self.number: int | str = int(label) if label.isdecimal() else label
        self.name = name if name is not None else known.name if known is not None else ""

    def __eq__(self, other: object) -> bool:
        if isinstance(other, FaultReading):
            return self.number == other.number
        if isinstance(other, str):
            if other and other == self.name:
                return True
            try:
                return FaultReading(self._model, self._model.fault(other).number) == self
            except ConfigError:
                return False
        return self.number == other

    def __hash__(self) -> int:
        return hash(self.number)

    def __repr__(self) -> str:
        return f"{self.number} ({self.name})" if self.name else str(self.number)


class DriveReadings:
    """See the module's docstring.  Every reading is the present one; speeds are rpm, currents A, torques N m.

    Without its supply a drive says nothing, and only its motor turns on.
    """

    def __init__(self, core: FarmCore, station: Axis, now: Callable[[], int]) -> None:
        self._core = core
        self._station = station
        self._now = now
        self._signals: tuple[tuple[int, ...], AxisSignals] | None = None

    @property
    def name(self) -> str:
        return self._station.configured_name

    @property
    def model(self) -> str:
        return self._station.model.name

    def snapshot(self) -> dict[str, Any]:
        """Everything at once, as ``GET drives/{name}`` gives it."""
        return drive_snapshot(self._core, self._station, self._now())

    # -- state

    @property
    def state(self) -> str:
        """``S1`` to ``S5``, ``boot``, or ``off``."""
        return state_word(self._station)

    @property
    def connected(self) -> bool:
        """Whether it exchanges data with a controller, be that in RUN or in STOP."""
        return self._station.powered and self._station.device.connected

    @property
    def faults(self) -> list[FaultReading]:
        """The active ones, the first one first."""
        return [self._reading(code) for code in self._axis.faults.code if code and self._station.powered]

    @property
    def active_fault(self) -> FaultReading | None:
        """The active one; None without."""
        return next(iter(self.faults), None)

    @property
    def last_fault(self) -> FaultReading | None:
        """The active one, or the one that was acknowledged last."""
        last = self.snapshot()["last_fault"]
        return None if last is None else FaultReading(self._station.model, last["number"])

    @property
    def warning(self) -> FaultReading | None:
        code = int(self._said(self._axis.warnings.code))
        return self._reading(code) if code else None

    # -- words and signals

    @property
    def stw1(self) -> Word:
        """The control word that the drive obeys, with its bits by name."""
        return self._word("STW1", int(self._said(self._axis.profidrive.stw1)), STW1, STW1_BITS)

    @property
    def zsw1(self) -> Word:
        """The status word, with its bits by name."""
        return self._word("ZSW1", int(self._said(self._axis.profidrive.zsw1)), ZSW1, ZSW1_BITS)

    @property
    def setpoints(self) -> Inputs:
        """The telegram's signals that came from the controller, by name: ``setpoints.nsoll_b`` in rpm."""
        view = Inputs(self._telegram().setpoints, self._image.received)
        view.valid = self._data_valid
        return view

    @property
    def actuals(self) -> Inputs:
        """The telegram's signals that the drive sends, by name: ``actuals.nist_b`` in rpm."""
        view = Inputs(self._telegram().actuals, self._image.sent)
        view.valid = self._data_valid
        return view

    # -- the axis

    @property
    def setpoint(self) -> float:
        """Speed set point, rpm."""
        return float(self._said(self._axis.ramp.setpoint))

    @property
    def velocity(self) -> float:
        """The motor's speed, rpm."""
        return float(self._axis.motor.velocity)

    @property
    def position(self) -> float:
        """From the home position, revolutions."""
        return float(self._axis.motor.position) - float(self._axis.homing.origin)

    @property
    def current(self) -> float:
        """The motor's current, A."""
        return float(self._axis.motor.current)

    @property
    def torque(self) -> float:
        """The motor's torque, N m."""
        return float(self._axis.motor.torque)

    @property
    def following_error(self) -> float:
        """Revolutions."""
        return float(self._said(self._axis.positioning.following_error))

    def events(self, text: str | None = None) -> list[LogEntry]:
        """What happened to it, oldest first (the last 64), or only entries with this text: ``fault``."""
        found = self._core.log.entries(self.name)
        return found if text is None else [entry for entry in found if entry.event == text]

    def __repr__(self) -> str:
        active = self.active_fault
        fault = f", fault {active}" if active is not None else ""
        link = "connected" if self.connected else "not connected"
        moves = f"{self.velocity:.1f} rpm, STW1 {self.stw1!r}"
        return f"<{type(self).__name__} {self.name} {self.state}, {link}{fault}, {moves}>"

    # -- inside

    @property
    def _axis(self) -> Any:
        return self._station.handle.axis

    @property
    def _image(self) -> Any:
        return self._station.handle.image

    def _said(self, value: Any) -> Any:
        return value if self._station.powered else 0

    @property
    def _data_valid(self) -> bool:
        return self._station.powered and bool(self._image.valid)

    def _reading(self, code: int) -> FaultReading:
        return FaultReading(self._station.model, int(code) & NUMBER_MASK)

    def _get_parameter(self, name: str | int) -> int:
        self._check_powered()
        return self._station.store.get(name)

    def _set_parameter(self, name: str | int, value: int) -> None:
        self._check_powered()
        self._station.store.set(name, value)

    def _check_powered(self) -> None:
        if not self._station.powered:
            raise ConfigError(f"{self.name} is switched off: its parameters cannot be accessed")

    def _word(self, name: str, value: int, slot: int, usual: tuple[str, ...]) -> Word:
        names = self._station.model.profidrive.bit_names(name, self._station.store.telegram_number) or usual
        return Word(value, SignalForm(name.lower(), slot, 16, False, 0.0, "", names))

    def _telegram(self) -> AxisSignals:
        store, settings = self._station.store, self._axis.profidrive.settings
        key = (store.telegram_number, *store.mapped_numbers(setpoint=True), -1, *store.mapped_numbers(setpoint=False))
        if self._signals is None or self._signals[0] != key:
            units = signal_units(
                velocity_step=float(settings.velocity_step),
                velocity_step_b=float(settings.velocity_step_b),
                target_step=float(settings.target_step) or float(self._axis.travel.settings.position_step),
                task_velocity_step=float(settings.task_velocity_step) or 1.0,
            )
            mapped = (store.mapping(setpoint=True), store.mapping(setpoint=False))
            self._signals = (
                key,
                axis_signals(
                    self._station.model.profidrive,
                    store.telegram_number,
                    units,
                    mapped if store.telegram.free_mapping else None,
                ),
            )
        return self._signals[1]
