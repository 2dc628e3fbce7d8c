"""What a user writes about a fault, and what is reported when it is wrong."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pnfarm.buses.registry import fault_kinds
from pnfarm.errors import ConfigError
from pnfarm.faults.effects.effect import Effect
from pnfarm.faults.errors import InjectionError
from pnfarm.faults.plan import matching

KINDS = fault_kinds()
DRIVES = {
    "axis-01": (("axis-01", "spindle"), ("kollmorgen-akd-profinet", "akd-profinet")),
    "axis-02": (("axis-02", "axis-02"), ("kollmorgen-akd-profinet", "akd-profinet")),
    "press": (("press", "press"), ("other",)),
}


def refused(**fields) -> str:
    with pytest.raises(InjectionError) as caught:
        KINDS.parse({key.rstrip("_"): value for key, value in fields.items()})
    return str(caught.value)


@pytest.mark.parametrize("kind", KINDS.values(), ids=lambda kind: kind.name)
def test_every_kind_says_what_it_does_and_has_an_effect(kind):
    assert kind.doc.endswith(".")
    assert issubclass(kind.effect, Effect)
    assert kind.effect.needs
    assert kind.takes <= {"probability", "seed", "count", "for", "cycles"}
    described = json.loads(json.dumps(kind.as_dict()))
    assert described["kind"] == kind.name
    for spec in kind.params.values():
        assert spec.doc
        assert spec.allowed
        if spec.default is not None:
            spec.read(spec.default)


def test_an_unknown_kind_is_reported_with_the_nearest_one():
    message = refused(kind="silense", on="all")
    assert "fault.kind: 'silense' is not a kind of fault, did you mean silence?" in message
    assert "loss" in message


def test_every_wrong_field_is_reported_with_what_is_allowed():
    message = refused(kind="loss", on=[], probability=2, cout=1, for_=3)
    lines = message.splitlines()
    assert len(lines) == 4
    assert any(line.startswith("fault.on: is []; allowed: a glob") for line in lines)
    assert "fault.probability: is 2; allowed: a number above 0, at most 1" in lines
    assert any("fault.cout: is not a field of an injection, did you mean count?" in line for line in lines)
    assert any(line.startswith("fault.for: is 3, which has no unit") for line in lines)


@pytest.mark.parametrize(
    ("fields", "told"),
    [
        ({"kind": "drive-fault"}, "fault.params.fault: is missing"),
        ({"kind": "drive-fault", "params": {"falt": 1, "fault": 702}}, "did you mean fault?"),
        ({"kind": "f702", "direction": "in"}, "fault.direction: is 'in'; allowed: none"),
        ({"kind": "iops-bad", "direction": "in"}, "fault.direction: is 'in'; allowed: out"),
        ({"kind": "f702", "probability": 0.5}, "fault.probability: means nothing for f702"),
        ({"kind": "f702", "count": 2, "for": "1s"}, "fault.count: does not go with"),
        ({"kind": "link-flap", "params": {"period": "1s", "down": "2s"}}, "fault.params.down: is '2s'"),
        ({"kind": "link-flap", "params": {"period": "1s", "down": "999.5ms"}}, "fault.params.down: is '999.5ms'"),
        ({"kind": "link-flap", "params": {"period": "2ns"}}, "fault.params.period: is '2ns'; allowed: a duration from"),
        ({"kind": "connect-refuse", "params": {"code1": 256}}, "fault.params.code1: is 256"),
        ({"kind": "record-error", "params": {"code": "module-falure"}}, "did you mean module-failure?"),
        ({"kind": "loss", "count": 1 << 63}, "fault.count: is 9223372036854775808; allowed: a whole number from 1 to"),
        (
            {"kind": "loss", "cycles": 1 << 32},
            "fault.cycles: is 4294967296; allowed: a whole number from 1 to 2^32 - 1",
        ),
        ({"kind": "loss", "after_cycles": 1 << 32}, "fault.after_cycles: is 4294967296; allowed: a whole number from"),
        ({"kind": "loss", "params": {"frames": "cyclc"}}, "did you mean cyclic?"),
        ({"kind": "late-application-ready", "params": {"delay": 5}}, "which has no unit"),
        ({"kind": "alarm-storm", "params": {"error": "wire-brake"}}, "did you mean wire-break?"),
        ({"kind": "diagnosis", "params": {"data": "0g"}}, "fault.params.data: is '0g'; allowed: octets in hexadecimal"),
        ({"kind": "diagnosis", "params": {"data": 12}}, "fault.params.data: is 12; allowed: octets in hexadecimal"),
        ({"kind": "diagnosis", "params": {"data": "00" * 129}}, "at most 128 octets"),
        ({"kind": "diagnosis", "params": {"channel": 0x8001}}, "fault.params.channel: is 32769"),
        ({"kind": "alarm-unacknowledged", "params": {"what": "no-nack"}}, "did you mean no-ack?"),
        ({"kind": "module-missing", "count": 2}, "fault.count: means nothing for module-missing"),
    ],
)
def test_a_field_that_the_kind_does_not_take_is_reported(fields, told):
    assert told in refused(**{"on": "all", **fields})


def test_several_misfits_with_the_kind_are_reported_at_once():
    message = refused(kind="f702", on="all", direction="in", probability=0.5)
    assert "fault.direction" in message
    assert "fault.probability" in message


def test_parameters_are_read_by_word_number_and_default():
    spec = KINDS.parse({"kind": "connect-refuse", "on": "all", "params": {"code1": "cmdev", "code2": "0x01"}})
    values = spec.values()
    assert (values["code1"], values["code2"]) == (0x3D, 1)
    assert KINDS.parse({"kind": "ar-abort", "on": "all"}).values() == {"code": 0x0D}
    assert KINDS.parse({"kind": "undervoltage", "on": "all"}).values() == {
        "fault": "undervoltage",
        "hold": True,
    }


def test_octets_are_read_from_hexadecimal_digits():
    def data(text):
        return KINDS.parse({"kind": "diagnosis", "on": "all", "params": {"data": text}}).values()["data"]

    assert data("0a1BFF") == bytes([0x0A, 0x1B, 0xFF])
    assert data("hex:0102") == bytes([1, 2])
    assert data("") == b""


def test_a_spec_survives_json():
    spec = KINDS.parse(
        {"kind": "loss", "on": "axis-*", "probability": 0.25, "seed": 7, "for": "1.5s", "after": "31.25us", "as": "x"}
    )
    assert KINDS.parse(json.loads(json.dumps(spec.as_dict()))) == spec
    assert spec.as_dict()["for"] == "1.5s"
    assert KINDS.schema()["properties"]["kind"]["enum"] == list(KINDS)


NAMES = ["kind", "on", "params", "probability", "for", "count", "as", "x"]
PARAMS = st.dictionaries(
    st.sampled_from(["hold", "fault", "code", "period"]),
    st.one_of(st.text(max_size=3), st.floats(), st.booleans()),
    max_size=2,
)
VALUES = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.floats(),
    st.text(max_size=8),
    st.sampled_from(list(KINDS)),
    st.lists(st.text(max_size=3), max_size=2),
    PARAMS,
)


@given(st.dictionaries(st.sampled_from(NAMES), VALUES, max_size=5))
def test_any_fields_give_a_spec_or_a_config_error(fields):
    try:
        spec = KINDS.parse(fields)
    except ConfigError:
        return
    spec.values()


@pytest.mark.parametrize(
    ("globs", "meant"),
    [
        (["all"], ["axis-01", "axis-02", "press"]),
        (["axis-*"], ["axis-01", "axis-02"]),
        (["spindle"], ["axis-01"]),
        (["model:akd-profinet"], ["axis-01", "axis-02"]),
        (["model:other", "axis-02"], ["axis-02", "press"]),
    ],
)
def test_globs_mean_drives_by_either_name_by_model_or_all(globs, meant):
    assert matching(globs, DRIVES) == meant


def test_a_glob_without_a_drive_is_reported_with_the_nearest_drive():
    with pytest.raises(InjectionError, match="no drive matches 'axis-1', did you mean axis-01"):
        matching(["axis-1"], DRIVES)
    with pytest.raises(InjectionError, match=r"no drive is of model 'akd'.*akd-profinet"):
        matching(["model:akd"], DRIVES)
