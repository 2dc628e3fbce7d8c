"""What is installed, and under which terms: the lock files, the bounds of pyproject.toml, and LICENSES.md."""

from __future__ import annotations

import importlib.metadata
import re
import tomllib
from pathlib import Path

import licenses
import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
GROUPS = PROJECT["dependency-groups"]
LOCKS = {
    "runtime.txt": PROJECT["project"]["dependencies"],
    "build.txt": GROUPS["build"],
    "release.txt": GROUPS["release"],
    "ci.txt": [
        *PROJECT["project"]["dependencies"],
        *GROUPS["build"],
        *GROUPS["docs"],
        *GROUPS["test"],
        *GROUPS["lint"],
    ],
    "peers.txt": [
        "cpppo>=5.2.5,<6",
        "greenery>=2.1,<3",
        "industriagents-profinet-mcp",
        "opcua>=0.98.13,<0.99",
        "pyprofibus>=1.13,<2",
        "uphy-upgen>=1.1,<2",
    ],
    "apart.txt": ["cm-ethernetip<0.2"],
}


@pytest.mark.parametrize("name", LOCKS)
def test_a_lock_names_every_package_in_a_version_that_the_project_takes(name):
    pinned = licenses.pinned(name)
    for text in LOCKS[name]:
        wanted = Requirement(text)
        versions = pinned[canonicalize_name(wanted.name)]
        assert all(wanted.specifier.contains(version) for version in versions), text


@pytest.mark.parametrize("name", LOCKS)
def test_every_package_of_a_lock_has_a_hash_and_no_place_that_it_comes_from(name):
    text = (ROOT / "locks" / name).read_text("utf-8")
    entries = re.sub(r"\s*\\\n\s+", " ", re.sub(r"^\s*#.*\n", "", text, flags=re.MULTILINE)).splitlines()
    assert entries
    for entry in entries:
        # a name, a version, a condition, hashes; no option of pip, no address, no path
        assert re.fullmatch(r"[a-z0-9.-]+==[^\s;]+( ; [A-Za-z_0-9 '.<>=!]+?)?( --hash=sha256:[0-9a-f]{64})+", entry), (
            entry
        )
    assert "://" not in text


def test_ci_tests_what_the_image_installs():
    tested = licenses.pinned("ci.txt")
    for name in ("runtime.txt", "build.txt"):
        for package, versions in licenses.pinned(name).items():
            assert tested[package] == versions


def test_every_supported_python_has_a_version_of_each_package():
    """A package that is listed more than once has conditions that leave no supported version out."""
    for name in LOCKS:
        # what asyncua and referencing take from the standard library in newer ones
        of_older = {"wait-for2": {"3.12", "3.13"}}
        if name == "release.txt":
            of_older["typing-extensions"] = {"3.13"}
        text = (ROOT / "locks" / name).read_text("utf-8")
        lines = [Requirement(line) for line in re.findall(r"^([a-z0-9.-]+==[^\\\n]+)", text, re.MULTILINE)]
        for package in {line.name for line in lines}:
            markers = [line.marker for line in lines if line.name == package]
            for version in ("3.11", "3.12", "3.13"):
                machine = {"python_version": version, "python_full_version": f"{version}.1", "sys_platform": "linux"}
                fits = sum(marker is None or marker.evaluate(machine) for marker in markers)
                assert fits == (version not in of_older.get(package, ())), (package, version)


@pytest.mark.parametrize("text", PROJECT["project"]["dependencies"])
def test_a_package_has_an_upper_bound_and_a_near_one_where_its_interface_is_not_stable(text):
    wanted = Requirement(text)
    (upper,) = [each.version for each in wanted.specifier if each.operator == "<"]
    (pinned, *_) = sorted(licenses.pinned("runtime.txt")[canonicalize_name(wanted.name)])
    if pinned.startswith("0."):
        assert upper == f"0.{int(pinned.split('.')[1]) + 1}"


def rows():
    found = re.findall(r"^\| ([a-z0-9.-]+) \| (.+?) \| (.*?) ?\|$", licenses.PAGE.read_text("utf-8"), re.MULTILINE)
    return {name: terms for name, terms, _ in found if name not in {"package", "what"}}


def test_the_terms_of_every_locked_package_are_listed():
    told = rows()
    named = {package for name in LOCKS for package in licenses.pinned(name)}
    assert set(told) == named
    assert "not stated in its metadata" not in told.values()


def test_the_terms_are_those_of_the_packages_metadata():
    """Of packages that are installed in their locked version; another version may word it in another way."""
    told, compared = rows(), 0
    pinned = {**licenses.pinned("peers.txt"), **licenses.pinned("ci.txt")}
    for package, versions in pinned.items():
        try:
            installed = importlib.metadata.version(package)
        except importlib.metadata.PackageNotFoundError:
            continue
        if installed in versions:
            compared += 1
            assert told[package] == licenses.terms(package)
    if compared == 0:
        pytest.skip("nothing is installed as locks/ has it: `make test`")


def test_the_licences_of_the_project_and_of_scapy_are_named():
    assert PROJECT["project"]["license"] == "GPL-2.0-or-later"
    assert rows()["scapy"] == "GPL-2.0-only"
    text = " ".join(licenses.PAGE.read_text("utf-8").split())
    assert "pnfarm itself is GPL-2.0-or-later" in text
    assert "`pnfarm decode` together with scapy is therefore under the terms of version 2 alone" in text
    # whoever asks for a version of the GPL that decode's process cannot have is told
    apart = {"prometheus-client", "opentelemetry-api", "junitparser", "sortedcontainers", "tzdata", "wait-for2"}
    assert {name for name, terms in rows().items() if name in licenses.pinned("runtime.txt") and alone(terms)} == apart


def alone(terms: str) -> bool:
    """Whether terms include Apache-2.0 without another to choose and without LLVM's exception."""
    return any(re.search(r"Apache", part) for part in terms.split(" AND ") if " OR " not in part and "WITH" not in part)


def test_what_the_newest_packages_are_tried_with_is_there():
    makefile = (ROOT / "Makefile").read_text("utf-8")
    (names,) = re.findall(r"^FAST := \$\(addprefix tests/,(.*)\)$", makefile, re.MULTILINE)
    assert [name for name in names.split() if not (ROOT / "tests" / name).exists()] == []
