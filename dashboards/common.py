"""Shared by both dashboards: names of states, reasons and bits, and the forms of their queries.

The names come from pnfarm itself, so that dashboards and command line use the same.  Queries are Prometheus's; the
metrics' names are those that pnfarm promises.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from panels import (
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    RED,
    YELLOW,
    Board,
    thresholds,
)

from pnfarm.metrics.collector import connection_numbers
from pnfarm.protocols.profinet.cm.ar import CmdevState

if TYPE_CHECKING:
    from collections.abc import Callable

FARM_UID = "pnfarm-farm"
DRIVE_UID = "pnfarm-drive"
#: Link from a value to the dashboard of its drive.
TO_DRIVE = f"/d/{DRIVE_UID}?var-farm=${{farm}}&${{__url_time_range}}&var-drive="
BY_LABEL = TO_DRIVE + "${__field.labels.drive}"

AR_STATES = connection_numbers("profinet")
DATA = AR_STATES[CmdevState.DATA]
#: PROFIdrive's states by ``pnfarm_axis_state``.
STATES: dict[int, tuple[str, str]] = {
    0: ("boot", GREY),
    1: ("S1 switching on inhibited", RED),
    2: ("S2 ready for switching on", ORANGE),
    3: ("S3 switched on", YELLOW),
    4: ("S4 operation", GREEN),
    5: ("S5 switching off", PURPLE),
}
CONNECTIONS: dict[int, tuple[str, str]] = {
    0: ("no connection", RED),
    **{
        number: (state, GREEN if state == CmdevState.DATA else RED if state == CmdevState.ABORT else YELLOW)
        for state, number in AR_STATES.items()
    },
}
BITS: dict[int, tuple[str, str]] = {0: ("0", "#3a3f47"), 1: ("1", BLUE)}
#: Bits that report trouble when set; the inverse ones are fine when set.
BAD_BITS = {"fault_present", "switching_on_inhibited", "warning_present"}

NONE_IS_GOOD = thresholds((None, GREEN), (1, RED))
#: A lateness of 1 ms is the limit for a send clock of 1 ms.
LATENESS = thresholds((None, GREEN), (0.00025, YELLOW), (0.001, RED))
RATE = "$__rate_interval"


def farm(metric: str, *more: str) -> str:
    """A metric of the chosen farm."""
    selector = ", ".join(('instance=~"$farm"', *more))
    return f"{metric}{{{selector}}}"


def drive(metric: str, *more: str) -> str:
    """A metric of the chosen drive."""
    return farm(metric, 'drive="$drive"', *more)


def station(metric: str, *more: str) -> str:
    """A metric of the station of the chosen drive: what all of its axes have together, such as its connection."""
    return farm(metric, 'drive="$station"', *more)


#: An injection acts on an axis, or on its station.
ACTIVATIONS = farm("pnfarm_fault_activations_total", 'drive=~"$drive|$station"')


def quantile(share: float, buckets: str, by: str = "le") -> str:
    """A quantile of a histogram over the rate interval."""
    return f"histogram_quantile({share}, sum by ({by}) (rate({buckets}[{RATE}])))"


def grown(counter: str, span: str) -> str:
    """Growth of a counter whose series appear when they first count: a new series has grown by its whole value."""
    return f"(({counter} unless {counter} offset {span}) or increase({counter}[{span}]))"


def connection(of: Callable[..., str], drives: Callable[..., str], on: str) -> str:
    """State of the connections ``of`` stations by CMDEV's numbers; on a bus without CMDEV as DATA, or none.

    ``on``: the labels that these have with their ``drives`` in common.
    """
    profinet = drives("pnfarm_drive_info", 'bus="profinet"')
    state = f"{of('pnfarm_ar_state')} and on ({on}) {profinet}"
    return f"({state}) or {DATA} * {of('pnfarm_ar_exchanging')}"


def with_model(expression: str) -> str:
    """An expression by instance and drive, with the drive's model as a label."""
    return f"({expression}) * on (instance, drive) group_left (model) {farm('pnfarm_drive_info')}"


def mean(histogram: str, selector: str) -> str:
    """Mean of a histogram's values in the shown range."""
    total, count = (f"sum({grown(f'{histogram}_{part}{selector}', '$__range')})" for part in ("sum", "count"))
    return f"{total} / ({count} > 0)"


def spaced(name: str) -> str:
    """A bit's name with spaces."""
    return name.replace("_", " ")


def farm_variable(board: Board) -> None:
    """The selection of a farm, in both dashboards."""
    board.variable(
        "farm",
        "Farm",
        "pnfarm_build_info",
        "instance",
        everything=True,
        description="Address at which the farm is scraped.",
    )


def station_variable(board: Board) -> None:
    """The station of the chosen drive: of an axis with a name of its own another one, else the drive itself."""
    named = f"label_replace({drive('pnfarm_axis_info')}, 'node', '$1', 'station', '(.+)')"
    own = f"label_replace({drive('pnfarm_drive_info')}, 'node', '$1', 'drive', '(.+)')"
    board.derived(
        "station",
        f"{named} or on (instance, drive) {own}",
        "node",
        description="Station that has the drive's connection.",
    )


def annotations(board: Board, *, of_drive: bool) -> None:
    """Marks for injected faults, the drives' own, and lost connections."""
    select = drive if of_drive else farm
    if of_drive:
        expression = f"{drive('pnfarm_drive_faults_active')} > 0"
        board.annotation("Injected faults", expression, "injected", "injected faults in force on $drive", PURPLE)
        expression = f"sum by (kind) ({grown(ACTIVATIONS, '10s')}) > 0"
        board.annotation("Injected fault acts", expression, "{{kind}}", "an injected fault acted on $drive", PURPLE)
    else:
        expression = f"sum by (kind) ({select('pnfarm_faults_active')}) > 0"
        board.annotation("Injected faults", expression, "{{kind}}", "fault {{kind}} active", PURPLE)
    expression = f"sum by (drive, code) ({grown(select('pnfarm_axis_faults_total'), '10s')}) > 0"
    board.annotation("Drive faults", expression, "F{{code}}", "fault {{code}} of {{drive}}", RED)
    aborts = (station if of_drive else farm)("pnfarm_ar_aborts_total")
    expression = f"sum by (drive, reason, cause) ({grown(aborts, '10s')}) > 0"
    text = "connection of {{drive}} aborted: {{reason}}, cause: {{cause}}"
    board.annotation("Connections lost", expression, "{{drive}}", text, ORANGE)
