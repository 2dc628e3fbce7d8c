"""An island with plain data: 7 octets of inputs in two submodules, 3 octets of outputs in two."""

from __future__ import annotations

from pnfarm.config.device import SignalPlace
from pnfarm.engine.columns import allocate
from pnfarm.signals.signal import place_signal
from pnfarm.signals.station_signals import StationSignals
from pnfarm.table.access.plain_data import ConsumedData, ProvidedData
from pnfarm.table.channel import IOXS_BAD, IOXS_GOOD

#: Name -> place, octets of inputs and outputs of its submodule.
SIGNALS = {
    "part_present": ({"at": "1.1.0.3"}, 1, 0),
    "pressure": ({"at": "3.1.0", "type": "int16", "unit": "bar", "scale": 0.01}, 6, 0),
    "code": ({"at": "3.1.2", "type": "octets[4]"}, 6, 0),
    "valve_1": ({"at": "2.1.0.1"}, 0, 1),
    "speed": ({"at": "4.1.0", "type": "uint16"}, 0, 2),
}
PLACES = {(1, 1, "input"): 0, (3, 1, "input"): 1, (2, 1, "output"): 0, (4, 1, "output"): 1}


def island(*, inputs: bool = True, more=None) -> StationSignals:
    """Its signals, and ``more`` in the second submodule."""
    found = allocate(images=1, axes=1, channels=1, plain=1, pieces=1)
    wanted = {**SIGNALS, **{name: (place, 6, 0) for name, place in (more or {}).items()}}
    known = {
        name: place_signal(name, SignalPlace.model_validate(place), i, o) for name, (place, i, o) in wanted.items()
    }
    kept = {name: one for name, one in known.items() if inputs or one.direction == "output"}
    provided = ProvidedData(found.provided, 0, 7, 2) if inputs else None
    return StationSignals(kept, PLACES, provided, ConsumedData(found.consumed, 0, 3, 2))


def sent_to_controller(signals: StationSignals) -> bytes:
    """The octets of the inputs."""
    return signals._inputs.read()


def controller_sends(signals: StationSignals, octets: bytes, good: tuple[bool, bool] = (True, True)) -> None:
    """What the engine does with a frame."""
    outputs = signals._outputs
    outputs._put(bytearray(octets + bytes(IOXS_GOOD if one else IOXS_BAD for one in good)))
