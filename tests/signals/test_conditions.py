"""Conditions over a drive's signals: grammar, names by model, units, and any text at all."""

from __future__ import annotations

import struct
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import pytest
from assembly_bench import ENABLE, MOVE, REVOLUTION, AssemblyBench, command
from hypothesis import example, given, settings
from hypothesis import strategies as st

from pnfarm.config.device import SignalPlace
from pnfarm.drives.catalogue import model, models
from pnfarm.signals.conditions import bind
from pnfarm.signals.signal import place_signal
from pnfarm.station.signals import STATUS_BITS, signal_names
from pnfarm.table.axis_codes import CMD_RAISE_FAULT
from pnfarm.vocabulary.conditions import ConditionError, evaluate, parse_condition, text_of

if TYPE_CHECKING:
    from collections.abc import Callable

    from pnfarm.drives.description.model import Model

AKD = model("akd-profinet")

KNOWN = {
    "zsw1.fault_present": True, "stw1.enable_operation": False, "state": "S4", "velocity": 1500.0, "fault": 702,
    "connected": True, "powered": True, "cycle": 0.016, "position": 0.3,
}  # fmt: skip


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("zsw1.fault_present", True),
        ("not zsw1.fault_present", False),
        ("stw1.enable_operation == 0", True),
        ("stw1.enable_operation == false and state == S4", True),
        ("S4 == state", True),
        ("state == 4", True),
        ("state != 1 and state != 2 and state != 3 and state != 5", True),
        ("state != 'S4'", False),
        ("velocity > 1000", True),
        ("velocity >= 1500 rpm and velocity < 1501", True),
        ("velocity > -5", True),
        ("fault == 702", True),
        ("fault == F702 or fault == 0", True),
        ("fault == none", False),
        ("connected and (velocity < 0 or not (state == S1))", True),
        ("connected or velocity > 0 and state == S1", True),
        ("cycle == 16ms", True),
        ("position > 90 deg", True),
    ],
)
def test_a_condition_is_read_as_a_tester_means_it(text: str, expected: bool) -> None:
    assert bind(text, AKD).holds(None, {}, KNOWN) is expected


EIP = model("akd-ethernetip")


class Drive:
    """A drive on the bench, as signals look at it."""

    powered = True

    def __init__(self, bench: AssemblyBench) -> None:
        self.bench, self.store, self.handle, self.model = bench, bench.store, bench.store.handle, EIP


def test_a_drive_on_ethernet_ip_has_the_conditions_of_any_axis_and_its_own_words() -> None:
    bench = AssemblyBench()
    drive = Drive(bench)

    def holds(text: str) -> bool:
        return bind(text, EIP).holds(drive, {})

    bench.send(command(0), 10)
    assert holds("ready and not enabled and not in_operation and at_rest and homed and state == S1")
    bench.enable(50)
    assert holds("ready and enabled and in_operation and state == S4 and not faulted")
    assert holds("control.enable and status_1.enable_state and not status_1.in_motion and control == 0x80")
    bench.load(
        ENABLE, MOVE, position=20 * REVOLUTION, velocity=10 * REVOLUTION, up=100 * REVOLUTION, down=100 * REVOLUTION
    )
    bench.run(500)
    assert holds("velocity > 500 rpm and not at_rest and task_active and not target_reached")
    assert holds("status_1.in_motion and status_2.load_complete and control.load_start and status_2.7")
    bench.run(3000)
    assert holds("at_rest and target_reached and status_1.in_position and position > 19.9 and position < 20.1")
    bench.store.handle.push_command(CMD_RAISE_FAULT, EIP.fault("702").code)
    bench.run(500)
    assert holds("faulted and fault == 702 and fault == 'communication-loss' and status_1.general_fault")
    assert holds("not ready and enabled and not in_operation"), "the controller still asks for it"
    bench.send(command(0), 10)
    assert holds("not enabled")


@pytest.mark.parametrize("name", STATUS_BITS)
def test_every_model_has_the_conditions_of_any_axis(name: str) -> None:
    for entry in models():
        assert set(bind(name, model(entry)).signals) == {name}


@pytest.mark.parametrize(
    ("text", "of"), [("zsw1.fault_present", EIP), ("stw1 == 0", EIP), ("control.enable", AKD), ("status_1 > 0", AKD)]
)
def test_a_drive_has_no_words_of_another_profile(text: str, of: Model) -> None:
    with pytest.raises(ConditionError, match="has no signal"):
        bind(text, of)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("zsw1.fault_presnt", "did you mean zsw1.fault_present"),
        ("velocty > 3", "column 1: akd-profinet has no signal 'velocty', did you mean velocity"),
        ("connected and velocty > 3", "column 15: "),
        ("state == S9", "state is never 'S9'"),
        ("state == 4rpm", "state is never '4rpm'"),
        ("state == 6", "state is never '6'"),
        ("state > S1", "has no order"),
        ("velocity", "no yes or no; allowed: such as `velocity > 0`"),
        ("velocity > 'fast'", "velocity is a number"),
        ("velocity > 5ms", "velocity is not measured in ms; allowed: a number in rpm"),
        ('param("DRV.OPMODE") == 1rpm', "plain number"),
        ("zsw1.fault_present == 2", "never 2; allowed: 0, 1, true or false"),
        ("fault == 70200", "has no fault '70200'"),
        ('param("DRV.OPMOD") == 1', "did you mean DRV.OPMODE"),
        ("param(1rpm) == 1", "param needs one name in quotes"),
        ('param("DRV.OPMODE" == 1', "param needs one name in quotes"),
        ("connected = 1", "= is not used here; allowed: `==`"),
        ("connected && powered", "allowed: `and`"),
        ("1 < velocity < 3", "comparisons are not chained"),
        ("1 == 1", "compares two values"),
        ("true", "is a value, not a condition"),
        ("(connected", "the parenthesis is not closed"),
        ("connected)", "is too much here"),
        ("", "is empty"),
        ("connected and", "ends where a name or a value is needed"),
        ("__import__('os')", "cannot be called"),
        ("(" * 60 + "connected" + ")" * 60, "nested too deeply"),
        ("not " * 200 + "connected", "nested too deeply"),
        (" or ".join(["faulted"] * 80), "too many names and values"),
        ("x" * 2000, "at most 1000"),
        ("velocity > 0x", "not measured in x"),
        ("zsw1.16", "has no signal"),
    ],
)
def test_what_is_wrong_is_one_sentence_with_its_column(text: str, sentence: str) -> None:
    with pytest.raises(ConditionError) as found:
        bind(text, AKD)
    assert sentence in str(found.value)
    assert "\n" not in str(found.value)


@pytest.mark.parametrize(
    ("text", "near"),
    [("zsw1.fault_presnt", lambda name: name[:5] == "zsw1."), ("velocty", lambda name: "." not in name)],
)
def test_the_names_near_to_a_wrong_one_are_listed(text: str, near: Callable[[str], bool]) -> None:
    error = refusal(lambda: bind(text, AKD))
    assert error is not None
    names = error.allowed.removesuffix(', param("NAME")').split(", ")
    assert names == [name for name in signal_names(AKD) if near(name)]


@pytest.mark.parametrize("name", sorted(name for name in models() if model(name).profile == "profidrive"))
def test_every_model_names_its_bits_and_its_faults(name: str) -> None:
    drive = model(name)
    assert bind("zsw1.operation_enabled and not zsw1.fault_present", drive)
    assert bind("zsw1.3 or stw1.bit_7", drive)
    for fault in drive.faults.values():
        assert bind(f'fault == "{fault.label}"', drive)
    assert bind("p930 == 1", drive)


def test_a_fault_with_a_location_is_written_as_in_its_manual() -> None:
    msd = model("moog-msd")
    bound = bind('fault == "32-1"', msd)
    assert bound.holds(None, {}, {"fault": msd.fault("32-1").number})
    assert not bound.holds(None, {}, {"fault": 32})


ISLAND = {"1st.cell-2": {name: place_signal(name, SignalPlace.model_validate(place), 8, 0) for name, place in {
    "part": {"at": "1.1.0.3"},
    "pressure": {"at": "1.1.0", "type": "int16", "unit": "bar", "scale": 0.1},
    "heat": {"at": "1.1.0", "type": "float32", "unit": "A"},
    "code": {"at": "1.1.0", "type": "octets[2]"},
    "word": {"at": "1.1.0", "type": "text[4]"},
}.items()}}  # fmt: skip


class Values:
    """Signals of a device with these values."""

    def __init__(self, **values: Any) -> None:
        self.get = values.__getitem__


@pytest.mark.parametrize(
    ("text", "values", "expected"),
    [
        ("1st.cell-2.part", {"part": True}, True),
        ("1st.cell-2.part == false", {"part": True}, False),
        ("not part or part != true", {"part": False}, True),
        # 11 * 0.1 is not 1.1
        ("1st.cell-2.pressure == 1.1", {"pressure": 11 * 0.1}, True),
        ("1st.cell-2.pressure <= 1.1 bar", {"pressure": 11 * 0.1}, True),
        ("pressure > 1.05", {"pressure": 11 * 0.1}, True),
        ("-1.1==pressure", {"pressure": -11 * 0.1}, True),
        ("pressure > 99999", {"pressure": 3.0}, False),
        ("heat == 100mA", {"heat": struct.unpack("f", struct.pack("f", 0.1))[0]}, True),
        ("code == '00ff'", {"code": b"\0\xff"}, True),
        ("code != '00'", {"code": b"\0\0"}, False),
        ("word == 'ok'", {"word": "ok"}, True),
        ("word == 'o\"k'", {"word": 'o"k'}, True),
    ],
)
def test_a_signal_of_a_device_is_compared_as_its_values_are(text: str, values: dict[str, Any], expected: bool) -> None:
    bound = bind(text, None, ISLAND, "1st.cell-2")
    devices = {"1st.cell-2": SimpleNamespace(signals=Values(**values))}
    assert bound.holds(None, devices) is expected
    assert bind(text_of(parse_condition(text)), None, ISLAND, "1st.cell-2").holds(None, devices) is expected
    assert text_of(parse_condition(text_of(bound.tree))) == text_of(bound.tree)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("1st.cell-2.prt", "1st.cell-2 has no signal 'prt', did you mean part"),
        ("1st.cell-3.part", "there is no device '1st.cell-3', did you mean 1st.cell-2?; allowed: 1st.cell-2"),
        ("part", "'part' is no signal of a device; allowed: STATION.SIGNAL"),
    ],
)
def test_a_signal_that_no_device_has_is_one_sentence(text: str, sentence: str) -> None:
    with pytest.raises(ConditionError) as found:
        bind(text, None, ISLAND)
    assert sentence in str(found.value)


@pytest.mark.parametrize("own", ["1st.cell-2", ""])
def test_any_device_is_powered_and_connected_or_not(own: str) -> None:
    text = "powered and not connected" if own else "1st.cell-2.powered and not 1st.cell-2.connected"
    bound = bind(text, None, ISLAND, own)
    for powered, connected in ((True, False), (False, False), (False, True), (True, True)):
        station = SimpleNamespace(powered=powered, device=SimpleNamespace(connected=connected))
        assert bound.holds(None, {"1st.cell-2": station}) is (powered and not connected)


@pytest.mark.parametrize("names", [["a", "a.b"], ["zsw1"], ["a-1", "a"]])
def test_a_station_with_dots_or_the_name_of_a_drives_word_is_found(names: list[str]) -> None:
    devices = dict.fromkeys(names, ISLAND["1st.cell-2"])
    for name in names:
        assert list(bind(f"{name}.part", AKD, devices).signals) == [f"{name}.part"]


def refusal(call: Callable[[], object]) -> ConditionError | None:
    try:
        call()
    except ConditionError as error:
        return error
    return None


@given(st.text(max_size=80))
@example("0" * 40)
@example("1e999 == velocity")
@example("\u0661 == velocity")
@example("a.b.c.d == .5")
@example("param(param)")
@example("1.2.a-b.3-")
@example("9" + ".a-" * 25)
@settings(max_examples=400, deadline=None)
def test_any_text_gives_a_tree_or_one_sentence(text: str) -> None:
    error = refusal(lambda: parse_condition(text))
    if error is not None:
        assert error.what
        assert error.allowed
        assert 1 <= error.column <= len(text) + 1


_PIECES = [
    "connected", "velocity", "zsw1.fault_present", "state", "S4", "fault", "702", "1.5", "rpm", "ms", "(", ")", "and",
    "or", "not", "==", "!=", "<", ">=", "-", "param", '("DRV.OPMODE")', "'x'", "true", "%", ".", "0x1f",
    "1st.cell-2.part", "1st.cell-2.pressure", "1st.cell-2.code", "1st.cell-2.no", "2nd-.x",
]  # fmt: skip


@given(st.lists(st.sampled_from(_PIECES), max_size=24).map(" ".join))
@settings(max_examples=600, deadline=None)
def test_words_of_the_language_in_any_order_bind_or_give_one_sentence(text: str) -> None:
    error = refusal(lambda: bind(text, AKD, ISLAND))
    if error is not None:
        assert "\n" not in str(error)
        return
    bound = bind(text, AKD, ISLAND)
    assert bound.holds(None, {}, dict.fromkeys(bound.signals, 0.0)) in {True, False}


def _pairs(inner: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
    both = st.tuples(inner, inner)
    return st.one_of(
        inner.map("not ({})".format),
        both.map(lambda pair: f"({pair[0]}) and ({pair[1]})"),
        both.map(lambda pair: f"{pair[0]} or {pair[1]}"),
    )


@given(st.recursive(st.sampled_from("abc"), _pairs, max_leaves=8), st.tuples(*[st.booleans()] * 3))
@settings(deadline=None)
def test_it_computes_what_python_computes_for_the_same_words(text: str, values: tuple[bool, ...]) -> None:
    known = dict(zip("abc", values, strict=True))
    error = refusal(lambda: parse_condition(text))
    if error is not None:
        assert "nested too deeply" in error.what
        return
    tree = parse_condition(text)
    expected = bool(eval(text, {}, known))
    assert evaluate(tree, lambda name: known[name.name]) is expected
    assert evaluate(parse_condition(text_of(tree)), lambda name: known[name.name]) is expected
