"""What a release is made of: archives that everybody can build again, a bill of materials, known vulnerabilities."""

from __future__ import annotations

import csv
import gzip
import hashlib
import io
import json
import os
import subprocess
import sys
import tarfile
from datetime import UTC, datetime, timedelta
from pathlib import Path

import advisories
import archives
import audit
import image
import licenses
import pytest
from locked import Locked, entries

PROJECT = """\
[build-system]
requires = ["hatchling"]
build-backend = "hatchling.build"
[project]
name = "thing"
version = "1.0"
requires-python = ">=3.11"
[tool.hatch.build.targets.wheel]
packages = ["thing"]
"""
#: A build that writes where it is.
HOOK = """\
from pathlib import Path
from hatchling.builders.hooks.plugin.interface import BuildHookInterface
class Here(BuildHookInterface):
    def initialize(self, version, build_data):
        Path(self.root, "thing", "place.py").write_text(repr(self.root))
"""


def committed(folder: Path, *, hook: str = "") -> Path:
    """A repository with a project of two modules and a program."""
    (folder / "thing").mkdir(parents=True)
    for name in ("zebra.py", "__init__.py"):
        (folder / "thing" / name).write_text(f"NAME = {name!r}\n")
    (folder / "thing" / "run.sh").write_text("#!/bin/sh\n")
    (folder / "thing" / "run.sh").chmod(0o755)
    (folder / "pyproject.toml").write_text(PROJECT + ("[tool.hatch.build.hooks.custom]\n" if hook else ""))
    if hook:
        (folder / "hatch_build.py").write_text(hook)
    for words in (["init", "-q"], ["add", "."], ["-c", "user.name=a", "-c", "user.email=a@b", "commit", "-qm", "one"]):
        subprocess.run(["git", *words], cwd=folder, check=True)
    return folder


def test_archives_have_the_same_octets_wherever_they_are_built(tmp_path, capsys):
    root = committed(tmp_path / "project")
    assert archives.main(["--root", str(root), "--out", str(tmp_path / "out"), "--twice"]) == 0
    said = capsys.readouterr()
    assert "built twice, the same octets: thing-1.0-py3-none-any.whl, thing-1.0.tar.gz" in said.out
    assert said.err == ""
    assert sorted(archives.parts(tmp_path / "out" / "thing-1.0-py3-none-any.whl"))[-3:] == [
        "thing/__init__.py", "thing/run.sh", "thing/zebra.py",
    ]  # fmt: skip


def test_a_build_that_writes_where_it_is_does_not_pass(tmp_path, capsys):
    root = committed(tmp_path / "project", hook=HOOK)
    command = ["--root", str(root), "--out", str(tmp_path / "out"), "--twice", "--target", "wheel"]
    assert archives.main(command) == 1
    said = capsys.readouterr()
    assert "1 of 7 members differ, the first is thing/place.py" in said.err
    assert "the same octets" not in said.out


def test_what_is_not_committed_is_in_no_archive(tmp_path, capsys):
    root = committed(tmp_path / "project")
    (root / "thing" / "secret.py").write_text("KEY = 1\n")
    assert archives.main(["--root", str(root), "--out", str(tmp_path / "out"), "--target", "wheel"]) == 0
    assert "1 changed or new files are not in it" in capsys.readouterr().err
    assert "thing/secret.py" not in archives.parts(tmp_path / "out" / "thing-1.0-py3-none-any.whl")


@pytest.mark.parametrize("umask", [0o002, 0o077])
def test_what_is_built_has_the_same_modes_whoever_copies_it(tmp_path, umask):
    root = committed(tmp_path / "project")
    before = os.umask(umask)
    try:
        archives.copy_commit(root, "HEAD", tmp_path / "copy")
    finally:
        os.umask(before)
    found = {path.name: path.stat().st_mode & 0o777 for path in (tmp_path / "copy").rglob("*")}
    assert found == {
        "pyproject.toml": 0o644, "thing": 0o755, "zebra.py": 0o644, "__init__.py": 0o644, "run.sh": 0o755,
    }  # fmt: skip


def layer_of(members: list[tuple[str, bytes | str]], later: int) -> bytes:
    """A layer: name and content of each file, or the file that a hard link is for, made so many seconds after EPOCH."""
    out = io.BytesIO()
    with tarfile.open(fileobj=out, mode="w") as archive:
        for name, content in members:
            member = tarfile.TarInfo(name)
            member.mtime, member.uname = EPOCH + later, f"builder-{later}"
            if isinstance(content, str):
                member.type, member.linkname = tarfile.LNKTYPE, content
            else:
                member.size = len(content)
            archive.addfile(member, io.BytesIO(content) if isinstance(content, bytes) else None)
    return out.getvalue()


def saved_image(file: Path, later: int, *, base: bytes = b"base", own: bytes = b"own", packed: bool = False) -> Path:
    """What ``docker save`` writes of an image with one layer of its base and one of its own, of some day."""
    first = layer_of([("base", base)], 0)
    made = [("b", own), ("a", b"1"), ("old", b"2"), ("c", "b")]
    second = layer_of(made if later else [made[1], made[0], made[2], made[3]], later)
    day = f"2026-01-01T00:00:{later:02}Z"
    config = {
        "architecture": "amd64", "os": "linux", "created": day, "container": f"c{later}", "docker_version": "20",
        "config": {"Hostname": f"h{later}", "User": "pnfarm", "Env": ["A=1"], "Image": f"sha256:{later}"},
        "history": [
            {"created": "2025-01-01T00:00:00Z", "created_by": "base"},
            {"created": day, "created_by": "ENV", "empty_layer": True}, {"created": day, "created_by": "COPY"},
        ],
        "rootfs": {"type": "layers", "diff_ids": []},
    }  # fmt: skip
    if packed:
        first, second = gzip.compress(first), gzip.compress(second)
    manifest = [{"Config": "x.json", "RepoTags": ["built"], "Layers": ["1/layer.tar", "2/layer.tar"]}]
    with tarfile.open(file, "w") as archive:
        for name, content in (
            ("1/layer.tar", first), ("2/layer.tar", second), ("x.json", json.dumps(config).encode()),
            ("manifest.json", json.dumps(manifest).encode()),
        ):  # fmt: skip
            member = tarfile.TarInfo(name)
            member.size = len(content)
            archive.addfile(member, io.BytesIO(content))
    return file


EPOCH = 1_700_000_000


@pytest.fixture
def settled(tmp_path):
    def settled(name: str, later: int, **contents) -> Path:
        out = tmp_path / f"{name}.tar"
        image.settle(saved_image(tmp_path / "saved.tar", later, **contents), out, "pnfarm:local", EPOCH, 1)
        return out

    return settled


def test_an_image_that_was_built_twice_on_different_days_has_the_same_octets(settled):
    one, other = settled("one", 0), settled("other", 50)
    assert one.read_bytes() == other.read_bytes()
    assert image.differences(one, other) == []


def test_an_engine_that_saves_layers_compressed_gives_the_same_octets(settled):
    assert settled("one", 0).read_bytes() == settled("other", 0, packed=True).read_bytes()


def test_a_settled_image_has_the_files_of_the_built_one_and_the_digests_of_its_layers(settled):
    with tarfile.open(settled("one", 50)) as archive:
        (manifest,) = json.load(archive.extractfile("manifest.json"))
        config = json.load(archive.extractfile(manifest["Config"]))
        layers = [archive.extractfile(name).read() for name in manifest["Layers"]]
    assert manifest["RepoTags"] == ["pnfarm:local"]
    assert config["config"] == {"Env": ["A=1"], "User": "pnfarm"}
    assert config["created"] == "2023-11-14T22:13:20Z"
    assert [entry["created"][:4] for entry in config["history"]] == ["2025", "2023", "2023"]
    assert config["rootfs"]["diff_ids"] == [f"sha256:{hashlib.sha256(layer).hexdigest()}" for layer in layers]
    assert layers[0] == layer_of([("base", b"base")], 0)
    found = image.members(io.BytesIO(layers[1]))
    assert list(found) == ["a", "b", "old", "c"]
    assert {mtime for _, _, _, _, mtime, _, _ in found.values()} == {EPOCH}
    assert found["c"][5] == "b"


def test_a_file_that_differs_between_two_builds_is_named(settled):
    found = image.differences(settled("one", 0), settled("other", 0, own=b"time"))
    assert found == ["layer 2: 1 members differ: b"]
    assert image.differences(settled("one", 0), settled("other", 0, base=b"newer")) == [
        "layer 1: 1 members differ: base"
    ]


@pytest.fixture(scope="module")
def sbom():
    module = pytest.importorskip("sbom", reason="the packages of locks/release.txt are not installed: `make test`")
    if any(
        licenses.distribution(entry.name).version != entry.version
        for entry in entries("runtime.txt")
        if entry.is_here()
    ):
        pytest.skip("not installed as locks/ has it: `make test`")
    return module


def test_the_bill_has_every_package_of_the_image_with_version_hashes_and_terms(sbom):
    text = sbom.bill(datetime(2026, 1, 2, tzinfo=UTC))
    assert sbom.complaint(text) == ""
    assert "'boat'" in sbom.complaint(text.replace('"type": "library"', '"type": "boat"', 1))
    read = json.loads(text)
    parts = {part["name"]: part for part in read["components"] if part["purl"].startswith("pkg:pypi/")}
    locked = {entry.name: entry for entry in entries("runtime.txt") if entry.is_here()}
    assert parts.keys() == locked.keys()
    for name, entry in locked.items():
        (archives_,) = parts[name]["externalReferences"]
        assert parts[name]["version"] == entry.version
        assert sorted(one["content"] for one in archives_["hashes"]) == list(entry.hashes)
        assert parts[name]["licenses"]
    assert parts["scapy"]["licenses"] == [{"license": {"id": "GPL-2.0-only"}}]
    assert parts["pyroute2"]["licenses"] == [{"expression": "GPL-2.0-or-later OR Apache-2.0"}]
    assert {part["name"] for part in read["components"]} - parts.keys() == {"htm", "preact", "uplot"}
    needs = {one["ref"]: one.get("dependsOn", []) for one in read["dependencies"]}
    root = read["metadata"]["component"]
    assert root["name"] == "pnfarm"
    assert any(ref.startswith("pkg:pypi/numba@") for ref in needs[root["bom-ref"]])
    # an extra's package, also one that another package needs, and what only such a one needs
    assert any(ref.startswith("pkg:pypi/cryptography@") for ref in needs[root["bom-ref"]])
    assert any(ref.startswith("pkg:pypi/psycopg-binary@") for ref in needs[parts["psycopg"]["bom-ref"]])


def test_the_bill_of_one_commit_is_always_the_same_and_another_ones_has_another_number(sbom):
    when = datetime(2026, 1, 2, tzinfo=UTC)
    assert sbom.bill(when) == sbom.bill(when)
    numbers = {json.loads(sbom.bill(when + timedelta(days=day)))["serialNumber"] for day in (0, 1)}
    assert len(numbers) == 2


def test_a_package_in_another_version_than_the_locked_one_is_not_billed(sbom, monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(sbom, "entries", lambda name: [Locked("numpy", "1.0", "", ("0" * 64,))])
    assert sbom.main(["--out", str(tmp_path / "out")]) == 4
    assert capsys.readouterr().err.startswith("numpy 1.0 is locked, ")
    assert not (tmp_path / "out").exists()


def test_the_table_of_terms_says_which_texts_a_package_holds(sbom):
    rows = {row["package"]: row for row in csv.DictReader(io.StringIO(sbom.table()))}
    assert rows["asyncua"]["terms"] == "GNU Lesser General Public License v3 or later (LGPLv3+)"
    assert rows["asyncua"]["texts"] == "licenses/COPYING"
    assert rows["pyserial"]["texts"] == "none in its archive"
    assert "never in one process with scapy" in rows["psycopg"]["note"]


def affected(*events, versions=()):
    return {"versions": list(versions), "ranges": [{"type": "ECOSYSTEM", "events": list(events)}]}


TWO = ({"introduced": "1"}, {"fixed": "1.4"}, {"introduced": "2"}, {"fixed": "2.2"})


@pytest.mark.parametrize(
    ("entry", "inside", "outside"),
    [
        (affected({"introduced": "0"}, {"fixed": "2.1"}), ["0.1", "2.0.9", "2.1rc1"], ["2.1", "2.1.post1", "3"]),
        (affected({"introduced": "1.5"}, {"last_affected": "2.0"}), ["1.5", "2.0"], ["1.4.9", "2.0.1"]),
        (affected(*TWO), ["1.0", "2.1"], ["1.4", "1.9", "2.2"]),
        # in whatever order they stand
        (affected(*reversed(TWO)), ["1.3", "2.1"], ["1.5", "2.3"]),
        (affected({"introduced": "3"}), ["3", "99"], ["2.9"]),
        # a list counts beside the ranges, and a version in another spelling is the same
        (affected({"introduced": "3"}, versions=["1.0", "bad version"]), ["1.0.0", "3.1"], ["1.0.1"]),
        ({"versions": ["1.0"]}, ["1.0"], ["1.1"]),
        # commits say nothing about versions
        ({"ranges": [{"type": "GIT", "events": [{"introduced": "0"}]}]}, [], ["1.0"]),
    ],
)  # fmt: skip
def test_a_version_is_affected_as_osvs_schema_has_it(entry, inside, outside):
    assert [version for version in inside if not advisories.is_affected(entry, version)] == []
    assert [version for version in outside if advisories.is_affected(entry, version)] == []


def advisory(number, package, *events, **more):
    return {
        "id": number, "aliases": [f"CVE-{number}"], "modified": datetime.now(UTC).isoformat(),
        "affected": [{"package": {"ecosystem": "PyPI", "name": package}, **affected(*events)}], **more,
    }  # fmt: skip


KNOWN = advisory("A-0", "Jinja2", {"introduced": "0"}, {"fixed": "2.11.3"})
ALL_NUMPY = ({"introduced": "0"}, {"fixed": "99"})


@pytest.fixture
def offline(tmp_path, capsys):
    """What the command says of a folder with these advisories: exit code, output, errors."""

    def run(*read):
        for one in read:
            (tmp_path / f"{one['id']}.json").write_text(json.dumps(one), "utf-8")
        (tmp_path / "README.md").write_text("no advisory")
        code = audit.main(["runtime.txt", "--offline", str(tmp_path)])
        return code, *capsys.readouterr()

    return run


def test_a_folder_of_advisories_that_names_nothing_of_the_lock_ends_with_0(offline):
    code, out, err = offline(KNOWN, advisory("A-1", "no-package-of-ours", {"introduced": "0"}))
    assert (code, err) == (0, "")
    count = len({(entry.name, entry.version) for entry in entries("runtime.txt")})
    assert out.startswith(f"of {count} versions of runtime.txt none with a known vulnerability (2 advisories in ")


def test_a_vulnerable_package_is_named_with_the_version_that_ends_it_and_the_code_is_1(offline):
    code, out, _ = offline(KNOWN, advisory("A-1", "NumPy", *ALL_NUMPY))
    assert code == 1
    versions = sorted(entry.version for entry in entries("runtime.txt") if entry.name == "numpy")
    assert out.splitlines()[:-1] == [f"numpy {version}: A-1, CVE-A-1, fixed in 99" for version in versions]


def test_a_withdrawn_advisory_is_none(offline):
    assert offline(KNOWN, advisory("A-1", "numpy", *ALL_NUMPY, withdrawn="2026-01-01T00:00:00Z"))[0] == 0


def test_old_advisories_are_no_all_clear_but_what_they_know_counts(offline):
    old = {**KNOWN, "modified": (datetime.now(UTC) - timedelta(days=50)).isoformat()}
    code, out, err = offline(old)
    assert code == 3
    assert "what became known in the last 50 days" in err
    assert "not looked up completely" in out
    assert offline(old, {**advisory("A-1", "numpy", *ALL_NUMPY), "modified": old["modified"]})[0] == 1


@pytest.mark.parametrize(
    ("read", "said"),
    [
        ((), "has no advisory"),
        ((advisory("A-1", "x", {"introduced": "0"}),), "does not know that jinja2 2.10 is vulnerable"),
        (({**KNOWN, "modified": ""},), "Invalid isoformat string: ''"),
    ],
)
def test_a_folder_without_advisories_or_with_a_few_is_no_all_clear(offline, read, said):
    code, out, err = offline(*read)
    assert (code, out) == (3, "")
    assert said in err


#: Answers as pip-audit does: of each wanted package, what stands in a table, or that it is not known.
STAND_IN = """\
import json, sys
wanted, out = (sys.argv[sys.argv.index(name) + 1] for name in ("--requirement", "--output"))
known = json.loads(sys.argv[1])
found = []
for line in open(wanted):
    name, version = line.strip().split("==")
    found.append({"name": name, "version": version, "vulns": known[name]} if name in known else
                 {"name": name, "skip_reason": "Dependency not found on PyPI"})
open(out, "w").write(json.dumps({"dependencies": found, "fixes": []}))
"""
LOOKED_UP = {"jinja2": [{"id": "P-1", "aliases": ["C-1"], "fix_versions": ["2.11.3"]}], "numpy": []}


@pytest.fixture
def asked(monkeypatch):
    """What ``look`` finds where pip-audit answers from a table; None: it has no network."""
    ask = audit.ask

    def look(known, versions=(("numpy", "2.4"), ("numpy", "2.5"))):
        program = "raise SystemExit('no network')" if known is None else STAND_IN
        monkeypatch.setattr(
            audit, "ask", lambda of, command: ask(of, [sys.executable, "-c", program, json.dumps(known)])
        )
        return audit.look(list(versions), "pypi", None)

    return look


def test_both_versions_of_a_package_are_looked_up(asked):
    assert asked(LOOKED_UP) == ([], [], "pip-audit, pypi")
    vulnerable = {**LOOKED_UP, "numpy": LOOKED_UP["jinja2"]}
    assert [finding.version for finding in asked(vulnerable)[0]] == ["2.4", "2.5"]


def test_an_index_without_data_and_no_network_are_no_all_clear(asked):
    # pip-audit itself ends with 0 and "No known vulnerabilities found"
    with pytest.raises(audit.NoAnswerError, match="has no data"):
        asked({})
    with pytest.raises(audit.NoAnswerError, match="has no data"):
        asked({"jinja2": [], "numpy": []})
    with pytest.raises(audit.NoAnswerError, match="no network"):
        asked(None)


def test_a_package_that_the_source_does_not_know_is_named(asked):
    found, unknown, _ = asked(LOOKED_UP, [("numpy", "2.4"), ("thing", "1.0")])
    assert found == []
    assert unknown == ["thing 1.0: Dependency not found on PyPI"]
