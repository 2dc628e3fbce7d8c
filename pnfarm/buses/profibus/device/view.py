"""The state of a slave for metrics and snapshots; read-only."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.buses.profibus.device.lamps import LampState
from pnfarm.protocols.profibus.slave import (
    BAD_LENGTH,
    CONFIGURED_WRONG,
    LEFT,
    PARAMETERS_AGAIN,
    PARAMETERS_WRONG,
    WATCHDOG,
)
from pnfarm.protocols.profibus.wire.dp import NO_MASTER, DpState
from pnfarm.station.device import ConnectionView

if TYPE_CHECKING:
    from pnfarm.buses.profibus.device.parts import SlaveParts

__all__ = ["CONNECTION_STATES", "USUAL_LOSSES", "connection_of", "details_of", "lamps_of", "losses_in_words", "view_of"]

_STATES = {
    DpState.WAIT_PRM: "WAIT_PRM",
    DpState.WAIT_CFG: "WAIT_CFG",
    DpState.DATA_EXCH: "DATA_EXCH",
}
#: States of the slave in the order of their numbers, from 1.
CONNECTION_STATES = tuple(_STATES.values())
#: The usual reasons for losing a master.
USUAL_LOSSES = (WATCHDOG, PARAMETERS_AGAIN, BAD_LENGTH)

_WORDS = {
    WATCHDOG: "the master sent nothing for longer than the watchdog",
    PARAMETERS_AGAIN: "the master parametrised it again",
    PARAMETERS_WRONG: "parameters that do not fit",
    CONFIGURED_WRONG: "a configuration that does not fit",
    BAD_LENGTH: "outputs of a wrong length",
    LEFT: "the drive left its data exchange",
}


def connection_of(device: SlaveParts) -> ConnectionView | None:
    """The master's hold on the slave; None while it waits for parameters."""
    slave = device.slave
    if slave.master == NO_MASTER:
        return None
    return ConnectionView(
        _STATES[slave.state],
        f"master {slave.master}",
        cycle_ns=device.cycle_ns,
        watchdog_ns=slave.watchdog_ns,
        connected_ns=device.connected_ns,
        cyclic=True,
        exchanging=slave.exchanging,
    )


def losses_in_words(device: SlaveParts) -> dict[str, int]:
    """Lost connections, by the reason in words."""
    return {_WORDS[reason]: count for reason, count in device.lost.items()}


def lamps_of(device: SlaveParts) -> dict[str, str]:
    """Each lamp, and how it is lit."""
    slave = device.slave
    state = LampState(
        powered=device.station.powered,
        booting=not device.station.on_the_wire,
        found=slave.found,
        exchanged=device.connects > device.connects_before,
        exchanging=slave.exchanging,
        clear=slave.clear,
        class_two=bool(slave.class_two.open),
        parameters_wrong=slave.faults.parameters,
        configuration_wrong=slave.faults.configuration,
    )
    return dict(device.kind.lamps(state))


def view_of(device: SlaveParts) -> dict[str, Any]:
    """Address, lamps, masters: a drive's data that only PROFIBUS has."""
    slave = device.slave
    return {
        "station_name": device.name,
        "lamps": lamps_of(device),
        "station_address": slave.address,
    }


def details_of(device: SlaveParts) -> dict[str, Any]:
    """What is set on its line, and by whom."""
    slave = device.slave
    return {
        "address_from": device.address_from,
        "master": None if slave.master == NO_MASTER else slave.master,
        "state": _STATES[slave.state],
        "baud": device.baud if slave.found else None,
        "clear": slave.clear,
        "class_2_masters": [master for master, _ in slave.class_two.open],
        "repeated_requests": slave.repeated,
        **device.kind.details(),
    }
