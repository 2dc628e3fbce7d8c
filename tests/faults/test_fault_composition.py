"""Several faults on one drive: each ends by itself, in any order, and nothing stays, whatever happens meanwhile."""

from functools import partial
from itertools import permutations

import pytest
from fault_line import FaultLine
from kinds_of import fits
from storm import BACK_SECONDS, LINES, MODELS, RUNNING_SECONDS, left_behind, line_of, model_for

from pnfarm.buses.registry import fault_kinds
from pnfarm.errors import ConfigError

FAMILIES = sorted({kind.family for kind in fault_kinds().values()})
#: Required parameters.
NEEDED = {"drive-fault": {"fault": 702}, "drive-warning": {"warning": 107}, "digital-input": {"input": 0}}
THREE = ("loss", "delay", "sign-of-life-freeze")


def three(line: FaultLine) -> dict:
    return {
        "loss": line.add("loss", direction="out", probability=0.2, seed=3, params={"frames": "cyclic"}),
        "delay": line.add("delay", direction="out", params={"delay": "9ms", "frames": "cyclic"}),
        "sign-of-life-freeze": line.add("sign-of-life-freeze"),
    }


def healthy(line: FaultLine) -> None:
    """Every cycle's frame arrives, with a count that goes on."""
    row = line.input_row()
    before = int(row.received)
    line.run(0.4)
    assert int(row.received) - before == 100
    assert line.losses() == 0
    assert left_behind(line) == {}


@pytest.mark.parametrize("order", list(permutations(THREE)), ids="-".join)
def test_loss_delay_and_a_frozen_sign_of_life_end_in_any_order_and_the_others_go_on(order):
    line = FaultLine(watchdog=30, **{**LINES["hiwin-e1"], "model": "hiwin-e1"})
    line.connect(20.0)
    line.run(0.5)
    faults = three(line)
    line.run(0.3)
    for position, name in enumerate(order):
        line.clear(faults[name].id)
        counted = {other: fault.evidence().activations for other, fault in faults.items()}
        line.run(0.3)
        for other, fault in faults.items():
            over = other in order[: position + 1]
            assert fault.state == ("ended" if over else "active")
            assert (fault.evidence().activations == counted[other]) is over, (name, other)
    healthy(line)


def test_a_reset_in_the_middle_ends_all_at_once_with_what_they_hold():
    line = FaultLine(watchdog=30, **{**LINES["hiwin-e1"], "model": "hiwin-e1"})
    line.connect(20.0)
    line.run(0.5)
    faults = three(line)
    line.run(0.302)
    assert int(line.farm.columns.engine[0].held_out), "a frame is on its way"
    line.clear()
    assert {fault.state for fault in faults.values()} == {"ended"}
    line.run(0.1)
    assert not int(line.farm.columns.engine[0].held_out)
    healthy(line)


#: What happens while faults of a family are in force.
MEANWHILE = {
    "power cycle": partial(FaultLine.add, kind="power-cycle", params={"off": "300ms"}),
    "reconnect": partial(FaultLine.add, kind="ar-abort"),
    "module pulled": partial(FaultLine.add, kind="module-missing", for_="500ms"),
    # of a PROFINET drive, which has no session: its connection
    "session dropped": partial(FaultLine.add, kind="session-drop", for_="500ms"),
    "farm stopped": lambda line: line.farm.stop(line.world.now),
    "reset": FaultLine.clear,
}


def put_all(line: FaultLine, family: str) -> int:
    """Every kind of the family that the drive takes at present."""
    taken = 0
    for kind in fault_kinds().values():
        if kind.family != family:
            continue
        seeded = {"seed": 11} if "seed" in kind.takes else {}
        try:
            line.add(kind.name, params=NEEDED.get(kind.name, {}), **seeded)
        except ConfigError:
            # the drive is full, or is mute already
            continue
        taken += 1
        line.run(0.05)
    return taken


@pytest.mark.parametrize("what", MEANWHILE)
@pytest.mark.parametrize(
    ("family", "model"),
    [
        pytest.param(family, model_for(kinds[0], name), id=family if name == "profinet" else f"{family}-{name}")
        for family in FAMILIES
        for name in MODELS
        if (kinds := [kind for kind in fault_kinds().values() if kind.family == family and fits(kind, name)])
    ],
)
def test_nothing_of_a_family_stays_after_what_happens_in_its_middle(family, model, what):
    if what == "module pulled" and model == MODELS["ethernetip"]:
        what = "session dropped"
    elif what == "session dropped" and model != MODELS["ethernetip"]:
        what = "reconnect"
    line = line_of(model, 1)
    assert put_all(line, family)
    MEANWHILE[what](line)
    line.run(1.0)
    line.clear()
    assert line.until(lambda: line.plc.all_connected, BACK_SECONDS), line.reasons()
    assert line.until(lambda: line.plc.all_running, RUNNING_SECONDS)
    assert left_behind(line) == {}
