"""Commands and options about who may reach a farm."""

import json
import stat
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from farm_flags import overridden

from pnfarm.api.access.token import token_of
from pnfarm.api.access.token_file import add_token
from pnfarm.farm.file.reading import FarmFileError, parse_farm
from pnfarm.web.roles import Role

FARM = "farm: a\nlink: {kind: memory}\napi: %s\ndrives: [{name: a, model: akd-profinet}]\n"


# -- certificates


def test_an_authority_is_made_once_and_each_further_certificate_is_by_it_for_the_same_names(pnfarm, tmp_path):
    folder = tmp_path / "tls"
    first = pnfarm("tls", "init", folder, "--host", "farm.local", "--host", "[fd00::7]")
    assert first.code == 0
    assert first.out.startswith(f"made the authority {folder}/ca.pem, until ")
    assert "for farm.local, fd00::7, localhost, 127.0.0.1, ::1, until" in first.out
    assert stat.S_IMODE((folder / "server.key").stat().st_mode) == 0o600
    assert stat.S_IMODE((folder / "ca.key").stat().st_mode) == 0o600
    authority, certificate = (folder / "ca.pem").read_text(), (folder / "server.pem").read_text()
    second = pnfarm("tls", "init", folder)
    assert second.out.startswith(f"kept the authority {folder}/ca.pem")
    assert "for farm.local, fd00::7, localhost" in second.out
    assert (folder / "ca.pem").read_text() == authority
    assert (folder / "server.pem").read_text() != certificate


def test_what_cannot_be_made_is_one_sentence(pnfarm, tmp_path):
    (tmp_path / "file").write_text("")
    (tmp_path / "half").mkdir()
    (tmp_path / "half" / "ca.pem").write_text("")
    for code, sentence, arguments in (
        (2, "--host 'https://x' is neither a name nor an address", (tmp_path / "a", "--host", "https://x")),
        (4, "cannot be written: not a directory", (tmp_path / "file" / "in",)),
        (2, "the authority of", (tmp_path / "half",)),
    ):
        found = pnfarm("tls", "init", *arguments)
        assert (found.code, found.err.count("\n")) == (code, 1)
        assert sentence in found.err
    assert not (tmp_path / "a").exists()


# -- tokens


def test_a_token_is_added_listed_and_removed_and_its_secret_is_printed_once(pnfarm, tmp_path):
    file = tmp_path / "tokens"
    secret = pnfarm("token", "add", file, "ci", "--role", "inject", "--expires", "30d").out
    assert len(secret.strip()) > 40
    assert secret.count("\n") == 1
    assert pnfarm("token", "add", file, "wall", "--expires", "never").code == 0
    assert secret.strip() not in file.read_text()
    listed = json.loads(pnfarm("token", "list", file, "--format", "json").out)["tokens"]
    assert [(one["name"], one["role"], one["expired"]) for one in listed] == [
        ("ci", "inject", False),
        ("wall", "read", False),
    ]
    ends = datetime.fromisoformat(listed[0]["expires"]) - datetime.now(UTC)
    assert timedelta(days=29) < ends <= timedelta(days=30)
    assert pnfarm("token", "remove", file, "ci").out == "removed ci\n"
    assert "ci" not in pnfarm("token", "list", file).out


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("add", "FILE", "ci", "--role", "root"), "--role 'root' is not a role; allowed: read, inject, admin"),
        (("add", "FILE", "ci", "--expires", "soon"), "--expires 'soon' is not a time; allowed: 30d"),
        (("add", "FILE", "ci", "--expires", "2020-01-31"), "--expires 2020-01-31 is over already"),
        (("add", "FILE", "ci", "--expires", "0d"), "--expires 0d is over already"),
        (("add", "FILE", "ci", "--expires", "9999-12-31T23:59:59-23:00"), "is not a time; allowed: 30d"),
        (("add", "FILE", "a b"), "'a b' is not a name"),
        (("list", "FILE"), "there is none; `pnfarm token add"),
        (("remove", "FILE", "ci"), "there is none; `pnfarm token add"),
    ],
)
def test_a_token_that_cannot_be_is_one_sentence_and_no_file(pnfarm, tmp_path, arguments, sentence):
    file = tmp_path / "tokens"
    found = pnfarm("token", *(file if word == "FILE" else word for word in arguments))
    assert (found.code, found.err.count("\n")) == (2, 1)
    assert sentence in found.err
    assert not file.exists()


def test_a_farm_and_a_hub_with_a_wrong_file_of_tokens_do_not_start(pnfarm, tmp_path):
    file = tmp_path / "tokens"
    file.write_text("ci\n")
    (tmp_path / "a.pnfarm.yml").write_text(FARM % "127.0.0.1:0")
    for command in (("up", tmp_path / "a.pnfarm.yml"), ("hub", "--shard", "x")):
        found = pnfarm(*command, "--tokens", file)
        assert (found.code, "line 1: a line has four words" in found.err) == (2, True)


def test_with_a_file_of_tokens_no_token_is_generated(tmp_path):
    add_token(tmp_path / "tokens", "ci", Role.READ, None)
    section = "{listen: '0.0.0.0:1', tokens: tokens%s}"
    (tmp_path / "a.pnfarm.yml").write_text(FARM)
    found = token_of(parse_farm(FARM % (section % "") + "state: ./state\n", tmp_path / "a.pnfarm.yml"))
    assert (found.value, found.file, found.in_log) == (None, None, None)
    assert [holder.name for holder in found.tokens.holders] == ["ci"]
    own = token_of(parse_farm(FARM % (section % ", token_file: own"), tmp_path / "a.pnfarm.yml"))
    assert own.file == tmp_path / "own"


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("--tls-cert", "nowhere"), "nowhere cannot be read: no such file"),
        (("--tls-key", "key"), "api.tls_key: is a key without a certificate"),
    ],
)
def test_a_farm_whose_certificate_cannot_serve_does_not_start(pnfarm, tmp_path, arguments, sentence):
    (tmp_path / "a.pnfarm.yml").write_text(FARM % "127.0.0.1:0")
    found = pnfarm("up", tmp_path / "a.pnfarm.yml", *arguments)
    assert found.code == 2
    assert sentence in found.err


def test_a_hub_whose_certificates_cannot_serve_does_not_start_and_leaves_no_audit_log(pnfarm, tmp_path):
    for arguments in (("--tls-cert", "nowhere"), ("--tls-key", "key"), ("--tls-ca", "nowhere")):
        found = pnfarm("hub", "--shard", "x", "--audit", tmp_path / "audit.jsonl", *arguments)
        assert (found.code, found.err.count("\n")) == (2, 1)
        assert not (tmp_path / "audit.jsonl").exists()


def test_a_certificate_of_the_command_line_is_where_the_user_is_and_one_of_the_file_beside_it(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = FARM % "{listen: '127.0.0.1:1', tls_cert: own.pem, tls_key: own.key, token: a-long-secret}"
    config = overridden(text, {"api": "0.0.0.0:2"})
    assert (config.api.tls_cert, config.api.tls_key, config.api.token) == ("own.pem", "own.key", "a-long-secret")
    config = overridden(text, {"audit": Path("log"), "tokens": Path("tokens")})
    assert (config.api.audit, config.api.tokens) == (str(tmp_path / "log"), str(tmp_path / "tokens"))
    assert config.api.tls_cert == "own.pem"
    config = overridden(text, {"tls_cert": tmp_path.relative_to(tmp_path) / "x.pem"})
    assert config.api.tls_cert == str(tmp_path / "x.pem")
    with pytest.raises(FarmFileError, match="tls_key: is a key without"):
        overridden(FARM % "127.0.0.1:1", {"tls_key": tmp_path / "x.key"})
