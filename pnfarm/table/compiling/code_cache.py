"""The cache of machine code, named by a digest of everything that the code was made of.

Numba's own cache checks only the file of the decorated function and would keep stale machine code when a *callee* in
another file changes.  Here each file's functions are in a folder named after the digest of that file and of all files
of the package that it imports, directly or not, together with the processor and the versions of Python, Numba and
NumPy.  So a change recompiles only what depends on it, and copies of the same sources share their code wherever they
are.

A wheel may hold machine code (``hatch_build.py``): :func:`take_packaged` copies what fits into the cache.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import os
import re
import shutil
import sys
import tempfile
import types
from pathlib import Path
from typing import Any

import llvmlite.binding
import numba
import numpy as np
from numba.core import caching

__all__ = [
    "REAL_TIME", "DigestLocator", "FunctionCache", "cache_directory", "copy_code", "is_cached", "is_usable",
    "kept_functions",
    "mark_cached", "take_packaged",
]  # fmt: skip

#: What a farm in real time over interfaces needs: all but what exchanges frames in memory.
REAL_TIME = "real-time"

_PACKAGE = Path(__file__).resolve().parents[2]
#: Machine code that a wheel may hold, by processor.
_PACKAGED = _PACKAGE / "machine_code"
#: Packages whose files hold compiled functions.
_COMPILED_ROOMS = ("table", "firmware", "engine")
#: An import that runs when the module is loaded; indented ones are for types or one function, never for machine code.
_IMPORT = re.compile(r"^(?:from ([a-z]\w*[.\w]*) import (\([^)]*\)|.*)|import ([.\w]+))", re.MULTILINE)


def cache_directory() -> Path:
    """Where machine code is kept: ``NUMBA_CACHE_DIR``, or ``$XDG_CACHE_HOME/pnfarm/code``."""
    explicit = os.environ.get("NUMBA_CACHE_DIR")
    if explicit:
        return Path(explicit)
    base = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    return Path(base) / "pnfarm" / "code"


@functools.cache
def _imported(path: Path) -> frozenset[Path]:
    """The files of the package, and those beside it, that a file imports."""
    found: set[Path] = set()
    for package, names, module in _IMPORT.findall(path.read_text("utf-8")):
        parts = (package or module).split(".")
        if parts[0] == _PACKAGE.name:
            place = _PACKAGE.parent.joinpath(*parts)
        elif path.is_relative_to(_PACKAGE) or len(parts) > 1:
            continue
        else:
            place = path.parent / parts[0]
        found.update(place / f"{name}.py" for name in re.findall(r"\w+", names))
        found.update((place.with_suffix(".py"), place / "__init__.py"))
    return frozenset(file for file in found if file.is_file())


@functools.cache
def _sources(path: Path) -> tuple[Path, ...]:
    """A file and all that it imports, directly or not."""
    found, new = set(), {path}
    while new:
        found |= new
        new = {other for file in new for other in _imported(file)} - found
    return tuple(sorted(found))


@functools.cache
def _file_digest(path: Path) -> bytes:
    return hashlib.sha256(path.read_bytes()).digest()


def _processor() -> str:
    return str(numba.config.CPU_NAME or llvmlite.binding.get_host_cpu_name())


def _digest(paths: tuple[Path, ...]) -> str:
    # machine code knows the layout of Python's objects, which is that of a minor version, and of NumPy's arrays
    of = (sys.implementation.cache_tag or "", numba.__version__, np.__version__.partition(".")[0], _processor())
    return _digest_for(paths, " ".join(of) + os.environ.get("NUMBA_BOUNDSCHECK", ""))


@functools.cache
def _digest_for(paths: tuple[Path, ...], of: str) -> str:
    # a file's functions have one folder, and each asks for it several times
    state = hashlib.sha256(of.encode())
    for path in paths:
        state.update(f"{path.parent.name}/{path.name}".encode())
        state.update(_file_digest(path))
    return state.hexdigest()[:16]


def _folder(path: Path) -> Path:
    return cache_directory() / f"{path.parent.name}.{path.stem}-{_digest(_sources(path))}"


@functools.cache
def _make(folder: str) -> None:
    """Make a folder; where that cannot be, as in a read-only image, what is there is loaded nevertheless."""
    with contextlib.suppress(OSError):
        os.makedirs(folder, exist_ok=True)  # noqa: PTH103 - a name, as Numba has it


def _named(value: Any) -> str:
    """A name for what a function takes from the one around it: the same in each process."""
    function = getattr(value, "py_func", value)
    if not isinstance(function, types.FunctionType):
        return getattr(value, "__name__", None) or repr(value)
    taken = ", ".join(_named(cell.cell_contents) for cell in function.__closure__ or ())
    return f"{function.__module__}.{function.__qualname__}({taken})"


class FunctionCache(caching.FunctionCache):  # type: ignore[misc]  # numba has no types
    """One function's machine code: the same octets whenever it is compiled with one ``PYTHONHASHSEED``."""

    def _index_key(self, sig: Any, codegen: Any) -> Any:
        """Numba's own has a digest of what it takes from the function around it, with numbers made at random.

        The folder's name is a digest of the sources already.
        """
        return sig, codegen.magic_tuple(), _named(self._py_func)

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep the code, without the text of its types for people, which names addresses."""
        super().save_overload(sig, data._replace(type_annotation=""))

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """What is kept for these types, None for nothing.

        Numba's own imports its whole compiler before it looks.  Kept code needs none of it, and a compilation does
        the same at its start: a third of a second of each start.
        """
        with self._guard_against_spurious_io_errors():
            return self._load_overload(sig, target_context)


class DigestLocator(caching._CacheLocator):  # type: ignore[misc]  # noqa: SLF001 - what Numba's setting for locators takes
    """Locates one function's machine code for Numba."""

    def __init__(self, function: Any, file: str) -> None:
        self._path = Path(file).resolve()
        self._line = function.__code__.co_firstlineno
        self._py_file = file  # Numba names it in a warning

    @classmethod
    def from_function(cls, py_func: Any, py_file: str) -> DigestLocator:
        """Numba's constructor."""
        locator = cls(py_func, py_file)
        _make(locator.get_cache_path())
        return locator

    def get_cache_path(self) -> str:
        """The folder of the function's file."""
        return str(_folder(self._path))

    def get_source_stamp(self) -> str:
        """Constant, because the folder's name depends on the sources already."""
        return ""

    def get_disambiguator(self) -> str:
        """Distinguishes functions of one name in one file."""
        return str(self._line)


def _compiled_files() -> tuple[Path, ...]:
    return tuple(sorted(path for room in _COMPILED_ROOMS for path in (_PACKAGE / room).rglob("*.py")))


def _mark(part: str) -> Path:
    """A file that exists when the machine code of these sources, this Numba and this type of processor is cached."""
    return cache_directory() / f"{part or 'complete'}-{_digest(_compiled_files())}-{_processor()}"


def is_cached(part: str = "") -> bool:
    """Whether all machine code, or all of ``part`` (:data:`REAL_TIME`), is cached: a start needs no compilation."""
    return any(_mark(one).exists() for one in {"", part})


def mark_cached(part: str = "") -> None:
    """Mark everything, or ``part``, as compiled; does nothing where the folder cannot be written."""
    with contextlib.suppress(OSError):
        _mark(part).touch()


def copy_code(place: Path) -> None:
    """Copy all machine code of these sources for this processor, and its mark, to ``place``/*processor*."""
    target = place / _processor()
    for path in _compiled_files():
        folder = _folder(path)
        if folder.is_dir():
            shutil.copytree(folder, target / folder.name, dirs_exist_ok=True)
    shutil.copy(_mark(""), target)


def is_usable() -> bool:
    """Whether machine code can be kept, or all of it is there already."""
    directory = cache_directory()
    with contextlib.suppress(OSError):
        directory.mkdir(parents=True, exist_ok=True)
    return os.access(directory, os.W_OK) or is_cached()


def take_packaged() -> None:
    """Copy the package's own machine code into the cache, if it is of these sources, this Numba and this processor.

    Several processes may do it at once; what cannot be written is compiled.
    """
    mark = _mark("") if _PACKAGED.is_dir() else None
    if mark is None or mark.exists():
        return
    packaged = _PACKAGED / _processor()
    if not (packaged / mark.name).exists():
        return
    with contextlib.suppress(OSError), tempfile.TemporaryDirectory(dir=cache_directory()) as beside:
        for folder in packaged.iterdir():
            if folder.is_dir() and not (place := cache_directory() / folder.name).exists():
                copy = shutil.copytree(folder, Path(beside) / folder.name)
                # another process may have been faster
                with contextlib.suppress(OSError):
                    copy.rename(place)
        mark.touch()


def kept_functions() -> int:
    """How many functions of these sources have cached machine code."""
    return sum(len(list(_folder(path).glob("*.nbi"))) for path in _compiled_files())
