"""Builds the image so that anybody gets the same octets: ``python release/image.py [--out FILE] [--twice]``.

What is built is the last commit, out of a clean copy, by the Docker engine of this machine.  The engine gives layers
and configuration the time of the build and names of its own.  So the image is taken out again (``docker save``) and
written anew: no time is later than that of the commit, members are in order, what names the builder is left out.
Layers of the base image stay as they are.  ``docker load -i FILE`` takes the result.

``--twice`` builds a second time without the engine's cache and compares octet by octet; exit code 1 if anything
differs.  The same octets need the same packages of the distribution and the same base image
(``--base debian@sha256:...``).
"""

from __future__ import annotations

import argparse
import gzip
import hashlib
import io
import json
import shutil
import subprocess
import sys
import tarfile
import tempfile
from datetime import UTC, datetime
from pathlib import Path
from typing import IO, Any, cast

from archives import ROOT, copy_commit, git, last_commit

BASE, TAG = "debian:bookworm-slim", "pnfarm:local"
#: What a container of the image needs; the rest of its configuration names the builder.
CONFIGURED = (
    "Cmd", "Entrypoint", "Env", "ExposedPorts", "Healthcheck", "Labels", "OnBuild", "Shell", "StopSignal", "User",
    "Volumes", "WorkingDir",
)  # fmt: skip
#: Differences that are named.
MOST_NAMED = 10


def docker(*arguments: str | Path) -> str:
    """What the client says; raises :class:`SystemExit` with the engine's words."""
    if shutil.which("docker") is None:
        raise SystemExit("an image needs the program docker and its engine")
    done = subprocess.run(["docker", *map(str, arguments)], capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(f"docker {arguments[0]}: {done.stdout[-2000:]}{done.stderr[-2000:]}")
    return done.stdout


def member_of(archive: tarfile.TarFile, name: str) -> IO[bytes]:
    """A file of an archive."""
    content = archive.extractfile(name)
    assert content is not None
    return content


def digest_of(path: Path) -> str:
    """As ``sha256sum`` prints it."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def plain(layer: IO[bytes]) -> IO[bytes]:
    """A layer as the configuration's digest is of; an engine with containerd's store saves it compressed."""
    is_packed = layer.read(2) == b"\x1f\x8b"
    layer.seek(0)
    return cast("IO[bytes]", gzip.GzipFile(fileobj=layer)) if is_packed else layer


def settle_layer(layer: IO[bytes], out: IO[bytes], epoch: int) -> None:
    """Write a layer anew: in order, nothing later than ``epoch``, owners by number."""
    with tarfile.open(fileobj=layer) as one, tarfile.open(fileobj=out, mode="w", format=tarfile.PAX_FORMAT) as other:
        # a hard link comes behind its file
        for member in sorted(one.getmembers(), key=lambda member: (member.islnk(), member.name)):
            member.mtime = min(int(member.mtime), epoch)
            member.uname = member.gname = ""
            kept = member.pax_headers.items()
            member.pax_headers = {key: value for key, value in kept if key.startswith("SCHILY.xattr.")}
            other.addfile(member, one.extractfile(member) if member.isreg() else None)


def settle_config(config: dict[str, Any], layers: list[str], epoch: int, keep: int) -> dict[str, Any]:
    """The configuration for ``layers`` (digests); the history of the first ``keep`` layers is the base image's."""
    created = datetime.fromtimestamp(epoch, UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    history, seen = [], 0
    for entry in config.get("history", []):
        seen += not entry.get("empty_layer", False)
        own = seen > keep or (seen == keep and entry.get("empty_layer", False))
        history.append({**entry, "created": created} if own else entry)
    return {
        "architecture": config["architecture"],
        "config": {key: value for key, value in sorted(config["config"].items()) if key in CONFIGURED and value},
        "created": created,
        "history": history,
        "os": config["os"],
        "rootfs": {"type": "layers", "diff_ids": [f"sha256:{layer}" for layer in layers]},
    }


def settle(saved: Path, out: Path, tag: str, epoch: int, keep: int) -> str:
    """Write what ``docker save`` wrote anew to ``out``; returns the image's id."""
    out.parent.mkdir(parents=True, exist_ok=True)
    with tarfile.open(saved) as one, tarfile.open(out, mode="w", format=tarfile.PAX_FORMAT) as other:

        def add(name: str, content: IO[bytes], size: int) -> None:
            member = tarfile.TarInfo(name)
            member.size, member.mtime = size, epoch
            other.addfile(member, content)

        (manifest,) = json.load(member_of(one, "manifest.json"))
        layers = []
        for number, name in enumerate(manifest["Layers"]):
            with tempfile.TemporaryFile() as layer:
                if number < keep:
                    shutil.copyfileobj(plain(member_of(one, name)), layer)
                else:
                    settle_layer(member_of(one, name), layer, epoch)
                size = layer.tell()
                layer.seek(0)
                layers.append(hashlib.file_digest(layer, "sha256").hexdigest())
                layer.seek(0)
                add(f"{layers[-1]}.tar", layer, size)
        config = json.dumps(
            settle_config(json.load(member_of(one, manifest["Config"])), layers, epoch, keep), sort_keys=True
        )
        digest = hashlib.sha256(config.encode()).hexdigest()
        entry = {"Config": f"{digest}.json", "RepoTags": [tag], "Layers": [f"{layer}.tar" for layer in layers]}
        for name, text in ((entry["Config"], config), ("manifest.json", json.dumps([entry]))):
            add(str(name), io.BytesIO(text.encode()), len(text.encode()))
    return f"sha256:{digest}"


def build(commit: str, out: Path, options: argparse.Namespace, *, again: bool = False) -> str:
    """Build a commit into the archive ``out``; returns the image's id."""
    epoch = int(git(options.root, "log", "-1", "--format=%ct", commit))
    with tempfile.TemporaryDirectory(prefix="pnfarm-image-") as folder:
        copy = Path(folder, *(("some", "where", "else") if again else ("copy",)))
        copy_commit(options.root, commit, copy)
        given = [f"SOURCE_DATE_EPOCH={epoch}", f"BASE={options.base}", *options.build_arg]
        words = [word for argument in given for word in ("--build-arg", argument)]
        words += [f"--network={options.network}"] if options.network else []
        tag = f"{options.tag}-built"
        docker("build", *words, *(["--no-cache"] if again else []), "-t", tag, copy)
        saved = Path(folder, "saved.tar")
        docker("save", "-o", saved, tag)
        keep = len(json.loads(docker("image", "inspect", "--format", "{{json .RootFS.Layers}}", options.base)))
        docker("rmi", tag)
        return settle(saved, out, options.tag, epoch, keep)


def members(layer: IO[bytes]) -> dict[str, tuple[Any, ...]]:
    """What a layer has, by name."""
    found: dict[str, tuple[Any, ...]] = {}
    with tarfile.open(fileobj=layer) as archive:
        for one in archive:
            file = archive.extractfile(one) if one.isreg() else None
            digest = hashlib.sha256(file.read()).hexdigest() if file else ""
            found[one.name] = (one.type, one.mode, one.uid, one.gid, one.mtime, one.linkname, digest)
    return found


def differences(first: Path, second: Path) -> list[str]:
    """In what two archives of :func:`settle` differ, a sentence each; nothing if they have the same octets."""
    if digest_of(first) == digest_of(second):
        return []
    found = []
    with tarfile.open(first) as one, tarfile.open(second) as other:
        layers = [json.load(member_of(archive, "manifest.json"))[0]["Layers"] for archive in (one, other)]
        if len(layers[0]) != len(layers[1]):
            return [f"{len(layers[0])} layers became {len(layers[1])}"]
        for number, (mine, theirs) in enumerate(zip(*layers, strict=True), 1):
            if mine == theirs:
                continue
            has, had = (members(member_of(archive, name)) for archive, name in ((one, mine), (other, theirs)))
            names = sorted(name for name in has.keys() | had.keys() if has.get(name) != had.get(name))
            found.append(
                f"layer {number}: {len(names)} members differ: {', '.join(names[:MOST_NAMED]) or 'their order'}"
            )
    return found or ["the layers are the same, the configuration is not"]


def main(arguments: list[str] | None = None) -> int:
    """Build, print the archive's digest and the image's id; 1 if the second build made something else."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--out", type=Path, default=ROOT / "dist" / "pnfarm-image.tar", help="the archive")
    parser.add_argument("--root", type=Path, default=ROOT, help="the repository (this one)")
    parser.add_argument("--base", default=BASE, help=f"the base image ({BASE}); with its digest, that one alone")
    parser.add_argument("--tag", default=TAG, help=f"the image's name ({TAG})")
    parser.add_argument("--build-arg", action="append", default=[], metavar="NAME=VALUE", help="as for docker build")
    parser.add_argument("--network", default="", help="as for docker build")
    parser.add_argument("--twice", action="store_true", help="build again without the cache, and compare")
    options = parser.parse_args(arguments)
    commit = last_commit(options.root)
    image = build(commit, options.out, options)
    sys.stdout.write(f"{digest_of(options.out)}  {options.out}\n{image}  {options.tag}\n")
    if not options.twice:
        return 0
    with tempfile.TemporaryDirectory(prefix="pnfarm-again-") as folder:
        second = Path(folder, "again.tar")
        build(commit, second, options, again=True)
        found = differences(options.out, second)
    for sentence in found:
        sys.stderr.write(f"not reproducible: {sentence}\n")
    if found:
        return 1
    sys.stdout.write(f"built twice, the same octets: {options.out.name}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
