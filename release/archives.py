"""Builds wheel and sdist so that anybody gets the same octets: ``python release/archives.py [--out FOLDER] [--twice]``.

What is built is the last commit, out of a clean copy: nothing that happens to lie in a work tree gets in.  The time of
that commit is ``SOURCE_DATE_EPOCH``; Hatchling sorts the files and gives them one mode.

``--twice`` builds a second time, from another copy elsewhere, with another umask, time zone, language and order of
hashes, and compares octet by octet; exit code 1 if anything differs.  The environment needs ``locks/build.txt``; with
``PNFARM_MACHINE_CODE=1`` (docs/supply-chain.md) ``locks/runtime.txt`` as well.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import shutil
import subprocess
import sys
import tarfile
import tempfile
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
#: What a second builder may have otherwise.  The first one has it as this process has.
OTHERWISE = {"LC_ALL": "C", "PYTHONHASHSEED": "4711", "TZ": "Asia/Kathmandu"}
#: A time that no file of the first copy has.
OLD_NS = 1_000_000_000 * 10**9


def git(root: Path, *arguments: str) -> str:
    """What git says of a repository."""
    return subprocess.run(["git", "-C", str(root), *arguments], capture_output=True, text=True, check=True).stdout


def last_commit(root: Path) -> str:
    """The commit that is built; files that are not in it are reported."""
    if changed := git(root, "status", "--porcelain").splitlines():
        sys.stderr.write(f"what is built is the last commit: {len(changed)} changed or new files are not in it\n")
    return git(root, "rev-parse", "HEAD").strip()


def copy_commit(root: Path, commit: str, place: Path, *, old: bool = False) -> None:
    """Put the files of a commit of ``root`` into ``place``; ``old``: with a time long ago, and few rights."""
    place.mkdir(parents=True)
    archive = place.with_suffix(".tar")
    # whoever copies it, by whatever umask: an image keeps the modes of what is copied into it
    git(root, "-c", "tar.umask=0022", "archive", "-o", str(archive), commit)
    subprocess.run(["tar", "-C", str(place), "-xpf", str(archive)], check=True)
    archive.unlink()
    if old:
        for path in place.rglob("*"):
            if path.is_file() and not path.is_symlink():
                path.chmod(0o700 if path.stat().st_mode & 0o100 else 0o600)
                os.utime(path, ns=(OLD_NS, OLD_NS))


def build(root: Path, commit: str, out: Path, targets: tuple[str, ...], *, otherwise: bool = False) -> list[Path]:
    """Build a commit of ``root`` into ``out``; returns what was made, by name."""
    epoch = git(root, "log", "-1", "--format=%ct", commit).strip()
    with tempfile.TemporaryDirectory(prefix="pnfarm-wheel-") as folder:
        copy = Path(folder, *(("some", "where", "else") if otherwise else ("copy",)))
        copy_commit(root, commit, copy, old=otherwise)
        made = Path(folder, "made")
        command = [sys.executable, "-m", "hatchling", "build", "-d", str(made)]
        # machine code is compiled anew, not taken from where the first build left it
        others = {**OTHERWISE, "NUMBA_CACHE_DIR": str(Path(folder, "code"))} if otherwise else {}
        done = subprocess.run(
            [*command, *(word for target in targets for word in ("-t", target))],
            cwd=copy, check=False, capture_output=True, text=True, umask=0o077 if otherwise else -1,
            env={**os.environ, **others, "SOURCE_DATE_EPOCH": epoch},
        )  # fmt: skip
        if done.returncode:
            raise SystemExit(f"no archives: {done.stdout}{done.stderr}")
        out.mkdir(parents=True, exist_ok=True)
        return [Path(shutil.copy(path, out)) for path in sorted(made.iterdir())]


def parts(archive: Path) -> dict[str, str]:
    """Digest of each member of a wheel or sdist."""
    if archive.suffix == ".whl":
        with zipfile.ZipFile(archive) as wheel:
            return {name: hashlib.sha256(wheel.read(name)).hexdigest() for name in wheel.namelist()}
    found = {}
    with tarfile.open(archive) as sdist:
        for member in sdist:
            file = sdist.extractfile(member)
            found[member.name] = hashlib.sha256(file.read() if file else b"").hexdigest()
    return found


def difference(first: Path, second: Path) -> str:
    """Why two archives are not the same octets, in one sentence; empty if they are."""
    if first.name != second.name:
        return f"{first.name} became {second.name}"
    if first.read_bytes() == second.read_bytes():
        return ""
    one, other = parts(first), parts(second)
    differ = sorted(name for name in one.keys() | other.keys() if one.get(name) != other.get(name))
    if not differ:
        return f"{first.name}: the members are the same, their times, modes or order are not"
    # the list of members with their digests differs with any of them
    differ = [name for name in differ if not name.endswith(".dist-info/RECORD")] or differ
    return f"{first.name}: {len(differ)} of {len(one)} members differ, the first is {differ[0]}"


def main(arguments: list[str] | None = None) -> int:
    """Build, print a line as ``sha256sum`` does for each archive; 1 if the second build made something else."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--out", type=Path, default=ROOT / "dist", help="folder of the archives (dist)")
    parser.add_argument("--root", type=Path, default=ROOT, help="the repository (this one)")
    parser.add_argument("--target", action="append", choices=("wheel", "sdist"), help="only this one")
    parser.add_argument("--twice", action="store_true", help="build again in other surroundings, and compare")
    options = parser.parse_args(arguments)
    targets = tuple(options.target or ("sdist", "wheel"))
    commit = last_commit(options.root)
    made = build(options.root, commit, options.out, targets)
    for path in made:
        sys.stdout.write(f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path}\n")
    if not options.twice:
        return 0
    with tempfile.TemporaryDirectory(prefix="pnfarm-again-") as folder:
        again = build(options.root, commit, Path(folder), targets, otherwise=True)
        names = {path.name for path in made} ^ {path.name for path in again}
        found = [f"{name} was built only once" for name in sorted(names)]
        found += [difference(*pair) for pair in zip(made, again, strict=False) if not names]
    for sentence in filter(None, found):
        sys.stderr.write(f"not reproducible: {sentence}\n")
    if any(found):
        return 1
    sys.stdout.write(f"built twice, the same octets: {', '.join(path.name for path in made)}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
