"""Writes what an installation, and the image, is made of: ``python release/sbom.py [--out FOLDER]``.

Two files: a bill of materials in CycloneDX's JSON (version, hashes and terms of each package of ``locks/runtime.txt``,
of pnfarm itself and of others' files in its source, and what needs what), and a table of terms.  Terms and dependencies
are from the metadata of the installed packages, so each has to be installed in its locked version (``make sbom``).  The
bill is checked against CycloneDX's schema before it is written.

The same commit gives the same octets under the same minor version of Python: the serial number is made of the content,
the time is ``SOURCE_DATE_EPOCH``, or that of the last commit.  Debian's packages in the image are not in it.
"""

from __future__ import annotations

import argparse
import csv
import io
import os
import sys
import uuid
from datetime import UTC, datetime
from pathlib import Path

import licenses
from archives import git
from cyclonedx.contrib.license.factories import LicenseFactory
from cyclonedx.model import ExternalReference, ExternalReferenceType, HashAlgorithm, HashType, Property, XsUri
from cyclonedx.model.bom import Bom, BomMetaData
from cyclonedx.model.component import Component, ComponentType
from cyclonedx.output.json import JsonV1Dot6
from cyclonedx.schema import SchemaVersion
from cyclonedx.validation.json import JsonStrictValidator
from locked import ROOT, Locked, entries
from packageurl import PackageURL
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

#: The image, and ``locks/runtime.txt``, have these.
EXTRAS = {"opcua", "postgres", "tls"}
#: Of serial numbers.
SPACE = uuid.uuid5(uuid.NAMESPACE_DNS, "pnfarm")


class NotAsLockedError(Exception):
    """What is installed, what is locked and what is needed do not fit; the message says what to do."""


def installed() -> list[Locked]:
    """The entries of the lock that this Python installs; raises NotAsLockedError unless they are."""
    found = [entry for entry in entries("runtime.txt") if entry.is_here()]
    for entry in found:
        try:
            version = licenses.distribution(entry.name).version
        except ModuleNotFoundError:
            version = "none"
        if version != entry.version:
            raise NotAsLockedError(f"{entry.name} {entry.version} is locked, {version} is installed: run `make sbom`")
    return found


def needs(names: set[str]) -> dict[str, set[str]]:
    """For pnfarm and each package, which of ``names`` it needs here, with the extras that others ask of it."""
    extras: dict[str, set[str]] = {"pnfarm": EXTRAS}
    found: dict[str, set[str]] = {}
    waiting = ["pnfarm"]
    while waiting:
        name = waiting.pop()
        asked = extras.get(name, set())
        found[name] = set()
        for text in licenses.distribution(name).requires or []:
            wanted = Requirement(text)
            other = canonicalize_name(wanted.name)
            marker = wanted.marker
            if marker is not None and not any(marker.evaluate({"extra": extra}) for extra in {"", *asked}):
                continue
            if other not in names:
                raise NotAsLockedError(f"{name} needs {other}, which locks/runtime.txt lacks: run `make lock`")
            found[name].add(other)
            if other not in found or wanted.extras - extras.get(other, set()):
                extras[other] = extras.get(other, set()) | wanted.extras
                waiting.append(other)
    return found


def component(name: str, version: str, terms: str, kind: str = "pypi", entry: Locked | None = None) -> Component:
    """One package; ``entry`` has the hashes of the archives that an installation takes it from."""
    url = PackageURL(type=kind, name=name, version=version)
    archives = ExternalReference(
        type=ExternalReferenceType.DISTRIBUTION,
        url=XsUri(f"https://pypi.org/project/{name}/{version}/#files"),
        comment="the archives that locks/runtime.txt permits",
        hashes=[HashType(alg=HashAlgorithm.SHA_256, content=content) for content in entry.hashes] if entry else [],
    )
    return Component(
        name=name, version=version, bom_ref=str(url), purl=url,
        type=ComponentType.APPLICATION if name == "pnfarm" else ComponentType.LIBRARY,
        licenses=[LicenseFactory().make_from_string(terms)],
        external_references=[archives] if entry else [],
    )  # fmt: skip


def vendored() -> list[Component]:
    """Others' files in pnfarm's source: the page's scripts."""
    said = [(what.split()[0].lower(), what.split()[1], terms) for what, _, terms, _ in licenses.VENDORED]
    return [component(name, version, terms, "npm") for name, version, terms in said]


def bill(when: datetime) -> str:
    """The bill of materials as JSON, of the schema's version 1.6."""
    locked = {entry.name: entry for entry in installed()}
    root = component("pnfarm", licenses.distribution("pnfarm").version, "GPL-2.0-or-later")
    parts = {
        name: component(name, entry.version, licenses.terms(name), "pypi", entry) for name, entry in locked.items()
    }
    carried = vendored()
    python = Property(name="pnfarm:python", value=f"{sys.version_info.major}.{sys.version_info.minor}")
    about = BomMetaData(component=root, timestamp=when, properties=[python])
    made = Bom(components=[*parts.values(), *carried], metadata=about)
    wanted = needs(set(locked))
    for name, others in wanted.items():
        depends = [parts[other] for other in sorted(others)] + (carried if name == "pnfarm" else [])
        made.register_dependency(root if name == "pnfarm" else parts[name], depends)
    if unneeded := sorted(locked.keys() - wanted.keys()):
        raise NotAsLockedError(f"nothing needs {', '.join(unneeded)} of locks/runtime.txt: run `make lock`")
    # first with the same number for all contents: the number is the content's
    made.serial_number = SPACE
    made.serial_number = uuid.uuid5(SPACE, JsonV1Dot6(made).output_as_string())
    return JsonV1Dot6(made).output_as_string(indent=2) + "\n"


def complaint(text: str) -> str:
    """What CycloneDX's schema has against a bill; empty if nothing."""
    return str(JsonStrictValidator(SchemaVersion.V1_6).validate_str(text) or "")


def table() -> str:
    """The terms as CSV: name, version, terms, texts that the installed package holds, a word on its use."""
    out = io.StringIO()
    rows = csv.writer(out, lineterminator="\n")
    rows.writerow(("package", "version", "terms", "texts", "note"))
    for entry in installed():
        name = entry.name
        texts = " ".join(licenses.texts(name)) or "none in its archive"
        rows.writerow((name, entry.version, licenses.terms(name), texts, licenses.NOTES.get(name, "")))
    for what, _, terms, text in licenses.VENDORED:
        name, version, *rest = what.split()
        rows.writerow((name, version, terms, text, " ".join(rest)))
    return out.getvalue()


def main(arguments: list[str] | None = None) -> int:
    """Write both files; 4 if what is installed is not what is locked."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--out", type=Path, default=ROOT / "dist", help="folder of the files (dist)")
    options = parser.parse_args(arguments)
    epoch = os.environ.get("SOURCE_DATE_EPOCH") or git(ROOT, "log", "-1", "--format=%ct")
    try:
        made = {"cdx.json": bill(datetime.fromtimestamp(int(epoch), UTC)), "licenses.csv": table()}
    except NotAsLockedError as error:
        sys.stderr.write(f"{error}\n")
        return 4
    assert not (said := complaint(made["cdx.json"])), said
    options.out.mkdir(parents=True, exist_ok=True)
    version = licenses.distribution("pnfarm").version
    for ending, text in made.items():
        path = options.out / f"pnfarm-{version}.{ending}"
        path.write_text(text, "utf-8")
        sys.stdout.write(f"{path}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
