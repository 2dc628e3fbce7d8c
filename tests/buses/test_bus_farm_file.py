"""A farm file has the keys of each bus where that bus's drives are, and no bus's keys elsewhere."""

from pathlib import Path

import pytest
import toybus
from toybus.bus import TOYBUS

from pnfarm.buses import registry
from pnfarm.config.known import Known, catalogue
from pnfarm.drives.catalogue import MODELS_VARIABLE, models
from pnfarm.farm.file.reading import FarmFileError, expand, parse_farm
from pnfarm.farm.file.schema import farm_schema

FILE = """\
farm: mixed
link: {{kind: {link}}}
drives:
  - {{name: axis-01, model: akd-profinet, ip: 10.77.0.11/23{axis}}}
  - {{name: 'toy-{{n}}', model: toy-servo, count: 2{toy}}}
"""


@pytest.fixture(autouse=True)
def known(monkeypatch):
    monkeypatch.setenv(MODELS_VARIABLE, str(Path(toybus.__file__).resolve().parent / "models"))
    with registry.registered(TOYBUS):
        yield Known(tuple(models()), catalogue().find)


def text(link="memory", axis="", toy=""):
    return FILE.format(link=link, axis=axis, toy=toy)


def told(known, **fields):
    with pytest.raises(FarmFileError) as caught:
        parse_farm(text(**fields), "f", known)
    return str(caught.value)


def test_a_group_has_the_keys_of_its_models_bus(known):
    axis, first, second = expand(parse_farm(text(axis=", telegram: 9", toy=", node: 5"), "f", known))
    assert (axis.telegram, first.node, second.node) == (9, 5, 6)
    assert not hasattr(axis, "node")
    assert not hasattr(first, "ip")


def test_drives_of_a_bus_without_keys_for_addresses_have_ports_of_their_own(known):
    macs = [drive.mac for drive in expand(parse_farm(text(), "f", known))]
    assert len(set(macs)) == 3
    assert all(len(mac) == 6 for mac in macs)


def test_a_key_of_another_bus_is_refused_with_that_buss_name(known):
    message = told(known, toy=", telegram: 1")
    assert message.startswith("f:5: drives[1].telegram: is a key of PROFINET, and this is a drive on ToyBus; allowed: ")
    assert ", node" in message
    assert "is a key of ToyBus, and this is a drive on PROFINET" in told(known, axis=", node: 1")


def test_a_key_of_no_bus_is_no_key(known):
    assert "drives[1].nod: is not a key here, did you mean node?" in told(known, toy=", nod: 1")


def test_a_value_of_a_buss_key_is_reported_with_its_bounds(known):
    assert "drives[1].node: is 127; allowed: a number from 0 to 126" in told(known, toy=", node: 127")


def test_a_buss_own_checks_are_made(known):
    assert "drives[1].node: counts past the last node; allowed: 0 to 126" in told(known, toy=", node: 126")


def test_a_value_that_must_be_unique_on_a_bus_is_reported_where_it_is_repeated(known):
    twice = text(toy=", node: 5") + "  - {name: other, model: toy-servo, node: 6}\n"
    with pytest.raises(FarmFileError) as caught:
        parse_farm(twice, "f", known)
    assert "drives[2].node: 'other': 6 belongs to 'toy-2' of drives[1] already" in str(caught.value)


def test_a_bus_is_refused_on_a_link_that_cannot_carry_it(known):
    message = told(known, link="veth")
    assert "drives[1].model: 'toy-servo' is on ToyBus, which a link of the kind veth does not carry" in message
    assert "drives[0]" not in message


def test_the_controller_is_that_of_the_first_bus_that_has_one(known):
    config = parse_farm(text() + "controller: {ip: 10.77.1.1/23, reduction_ratio: 16}\n", "f", known)
    assert config.controller.reduction_ratio == 16


def test_a_group_of_an_unknown_model_is_read_by_the_keys_that_it_has(known):
    with pytest.raises(FarmFileError) as caught:
        parse_farm(text().replace("toy-servo, count: 2", "toy-serv, node: 3"), "f", known)
    assert "did you mean toy-servo?" in str(caught.value)
    assert "drives[1].node" not in str(caught.value)


def test_the_schema_has_the_keys_of_every_bus_and_says_which_models_have_them(known):
    schema = farm_schema(known)
    group = schema["$defs"]["DriveGroup"]
    assert {"node", "telegram", "ip"} <= set(group["properties"])
    rules = [rule for rule in group["allOf"] if rule["then"]["properties"].get("telegram") is False]
    (rule,) = [rule for rule in rules if rule["if"]["properties"]["model"]["enum"] == ["toy-servo"]]
    assert "node" not in rule["then"]["properties"]
