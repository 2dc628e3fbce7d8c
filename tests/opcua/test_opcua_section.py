"""The section `opcua` of a farm file, and who is let in."""

import asyncio

import pytest
from cell_file import CELL

from pnfarm.errors import EnvironmentError_
from pnfarm.farm.farm import Farm
from pnfarm.farm.file.reading import FarmFileError, parse_farm
from pnfarm.opcua import prepare_opcua, serving

CERTIFIED = "certificate: farm.pem, key: farm.key"


def prepared(text):
    return asyncio.run(prepare_opcua(Farm(parse_farm(CELL + text))))


def section(text):
    return parse_farm(f"{CELL}opcua: {text}\n").opcua


def test_a_farm_without_the_section_has_no_server():
    assert parse_farm(CELL).opcua is None
    assert section("off") is None
    assert prepared("") is None


def test_an_address_alone_or_on_is_enough_on_this_machine():
    assert section("on").listen == ("127.0.0.1", 4840)
    assert section("127.0.0.1:4841").listen == ("127.0.0.1", 4841)
    assert section("{interval: 50ms}").interval_ns == 50_000_000


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("0.0.0.0:4840", "listens beyond loopback without a user and a certificate"),
        ("{listen: '10.0.0.1:4840', user: scada, password: a-long-secret}", "listens beyond loopback"),
        ("{listen: 'plant.example:4840', " + CERTIFIED + "}", "listens beyond loopback"),
        ("{user: scada}", "either `password` or `password_file`"),
        ("{user: scada, password: a-long-secret, password_file: secret}", "either `password` or `password_file`"),
        ("{password: a-long-secret}", "has a password or a read_user, and no user"),
        ("{read_user: viewer, read_password: a-long-secret}", "has a password or a read_user, and no user"),
        ("{user: scada, password: a-long-secret, read_user: viewer}", "has one of read_user and read_password"),
        (
            "{user: scada, password: a-long-secret, read_user: scada, read_password: a-long-secret}",
            "has one name for user and read_user",
        ),
        ("{certificate: farm.pem}", "has one of certificate and key"),
        ("{interval: 1ms}", "10ms to 60s"),
        ("{user: scada, password: short}", "8"),
        ("127.0.0.1", "HOST:PORT"),
        ("{port: 4840}", "port"),
    ],
)
def test_what_is_unsafe_or_incomplete_is_refused_with_what_is_allowed(text, said):
    with pytest.raises(FarmFileError) as refused:
        section(text)
    assert said in str(refused.value)
    assert ": opcua" in str(refused.value)


@pytest.mark.parametrize("key", ["password", "read_password"])
def test_a_password_that_yaml_takes_for_a_number_is_in_no_message(key):
    with pytest.raises(FarmFileError) as refused:
        section(f"{{user: scada, {key}: 4711081500}}")
    assert f"opcua.{key}: is not text: put it in quotes" in str(refused.value)
    assert "4711081500" not in str(refused.value)


def test_a_password_is_not_in_the_text_of_its_section():
    assert "a-long-secret" not in repr(section("{user: scada, password: a-long-secret}"))


@pytest.mark.parametrize("host", ["localhost", "LocalHost", "127.0.0.7", "[::1]"])
def test_an_address_of_this_machine_alone_needs_no_user(host):
    assert section(f"'{host}:4840'").is_loopback


def test_beyond_this_machine_a_user_and_a_certificate_are_enough():
    found = section("{listen: '0.0.0.0:4840', user: scada, password: a-long-secret, " + CERTIFIED + "}")
    assert not found.is_loopback


def test_a_farm_without_the_extra_says_what_to_install(monkeypatch):
    monkeypatch.setattr(serving, "find_spec", lambda _: None)
    with pytest.raises(EnvironmentError_, match=r"opcua: needs `pip install 'pnfarm\[opcua\]'`"):
        prepared("opcua: on\n")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("{listen: '127.0.0.1:0', user: scada, password_file: none}", "the password's file none: no such file"),
        ("{listen: '127.0.0.1:0', user: scada, password_file: short}", "holds no password: 8 to 512 characters"),
        ("{listen: '127.0.0.1:0', " + CERTIFIED + "}", "opcua.certificate: farm.pem cannot be used"),
        ("{listen: '127.0.0.1:0', certificate: short, key: short}", "opcua.certificate: short cannot be used"),
    ],
)
def test_a_file_that_cannot_be_used_is_named_before_the_farm_starts(text, said, tmp_path, monkeypatch):
    pytest.importorskip("asyncua")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "short").write_text("short\n")
    with pytest.raises(EnvironmentError_, match=said.replace(".", r"\.")):
        prepared(f"opcua: {text}\n")


@pytest.mark.parametrize(
    ("text", "anonymous", "writes"),
    [
        ("on", True, True),
        ("{user: scada, password: a-long-secret}", True, False),
        (
            "{user: scada, password: a-long-secret, read_user: viewer, read_password: another-secret}",
            False,
            False,
        ),
        ("{listen: '0.0.0.0:1', user: scada, password: a-long-secret, " + CERTIFIED + "}", False, False),
    ],
)
def test_who_names_no_user_may_what_the_file_allows(text, anonymous, writes):
    pytest.importorskip("asyncua")
    from pnfarm.opcua.access import Access

    found = section(text)
    access = Access(found, found.password)
    assert (access.get_user(None) is not None) is anonymous
    assert access.may_write(None) is writes
    if found.user:
        assert access.get_user(None, "scada", "a-long-secret").name == "scada"
        assert access.may_write("scada")
        assert access.get_user(None, "scada", "another-secret") is None
    if found.read_user:
        assert access.get_user(None, "viewer", "another-secret").name == "viewer"
        assert not access.may_write("viewer")
