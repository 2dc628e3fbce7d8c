"""Commands and options about who may reach a farm."""

from __future__ import annotations

import stat

import pytest
from farm_flags import overridden

from pnfarm.farm.file.reading import FarmFileError

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


def test_a_hub_whose_certificates_cannot_serve_does_not_start(pnfarm):
    for arguments in (("--tls-cert", "nowhere"), ("--tls-key", "key"), ("--tls-ca", "nowhere")):
        found = pnfarm("hub", "--shard", "x", *arguments)
        assert (found.code, found.err.count("\n")) == (2, 1)


def test_a_certificate_of_the_command_line_is_where_the_user_is_and_one_of_the_file_beside_it(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = FARM % "{listen: '127.0.0.1:1', tls_cert: own.pem, tls_key: own.key, token: a-long-secret}"
    config = overridden(text, {"api": "0.0.0.0:2"})
    assert (config.api.tls_cert, config.api.tls_key, config.api.token) == ("own.pem", "own.key", "a-long-secret")
    config = overridden(text, {"tls_cert": tmp_path.relative_to(tmp_path) / "x.pem"})
    assert config.api.tls_cert == str(tmp_path / "x.pem")
    with pytest.raises(FarmFileError, match="tls_key: is a key without"):
        overridden(FARM % "127.0.0.1:1", {"tls_key": tmp_path / "x.key"})
