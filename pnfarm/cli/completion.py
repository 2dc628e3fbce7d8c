"""Words that a shell completes: what is installed, and what a running farm has.

``pnfarm --install-completion`` installs it.  A farm that does not run, or that does not know this user, offers nothing.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import typer  # noqa: TC002 - typer reads the annotations

from pnfarm.errors import PnfarmError
from pnfarm.terminal import client
from pnfarm.terminal.settings import DEFAULT_URL

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    Words = Callable[[client.FarmClient], Iterable[tuple[str, str]]]


__all__ = [
    "complete_benchmark",
    "complete_drive",
    "complete_fault",
    "complete_kind",
    "complete_model",
    "complete_signal",
]

#: Of the help beside a word, characters.
_LONGEST = 70


def _fitting(words: Iterable[tuple[str, str]], incomplete: str) -> list[tuple[str, str]]:
    return [(word, _shortened(text)) for word, text in words if word.startswith(incomplete)]


def _shortened(text: str) -> str:
    line = " ".join(text.split())
    return line if len(line) <= _LONGEST else f"{line[: _LONGEST - 1]}…"


def complete_model(incomplete: str) -> list[tuple[str, str]]:
    """Drive models."""
    from pnfarm.drives.catalogue import models

    return _fitting(((name, entry.title) for name, entry in models().items()), incomplete)


def complete_kind(incomplete: str) -> list[tuple[str, str]]:
    """Kinds of faults."""
    from pnfarm.buses.registry import fault_kinds

    return _fitting(((kind.name, kind.doc) for kind in fault_kinds().values()), incomplete)


def complete_benchmark(incomplete: str) -> list[tuple[str, str]]:
    """Benchmarks and their figures."""
    from pnfarm.bench.catalogue import BENCHMARKS

    names = dict.fromkeys(BENCHMARKS, "benchmark")
    for name, one in BENCHMARKS.items():
        for figure in one.figures:
            names.setdefault(figure, f"figure of {name}")
    return _fitting(names.items(), incomplete)


def complete_drive(ctx: typer.Context, incomplete: str) -> list[tuple[str, str]]:
    """Drives of the running farm."""
    return _of_farm(ctx, incomplete, _listed("drives", "name", "model"))


def complete_signal(ctx: typer.Context, incomplete: str) -> list[tuple[str, str]]:
    """Devices, drives and models of the plant of the running farm; after one of them and a dot its signals."""

    def words(farm: client.FarmClient) -> Iterable[tuple[str, str]]:
        known = {one["name"]: str(one["description"] or one["bus"]) for one in farm.get("devices")["devices"]}
        for name, what in {**known, **{one["name"]: one["kind"] for one in farm.get("plant")["models"]}}.items():
            yield name, what
            if incomplete.startswith(f"{name}."):
                for signal in farm.get("devices", name, "signals")["signals"]:
                    yield f"{name}.{signal['name']}", f"{signal['direction']}, {signal['type']}"
        for drive in farm.get("drives")["drives"]:
            yield drive["name"], drive["model"]
            if incomplete.startswith(f"{drive['name']}."):
                for signal in farm.get("drives", drive["name"], "signals")["signals"]:
                    yield f"{drive['name']}.{signal['name']}", signal["doc"]

    return _of_farm(ctx, incomplete, words)


def complete_fault(ctx: typer.Context, incomplete: str) -> list[tuple[str, str]]:
    """Faults of the running farm."""
    return _of_farm(ctx, incomplete, _listed("faults", "id", "kind"))


def _listed(path: str, word: str, kind: str) -> Words:
    """The entries of a list of the API."""
    return lambda farm: [(one[word], f"{one[kind]}, {one['state']}") for one in farm.get(path)[path]]


def _of_farm(ctx: typer.Context, incomplete: str, words: Words) -> list[tuple[str, str]]:
    try:
        with client.FarmClient(
            ctx.params.get("api") or DEFAULT_URL, ctx.params.get("token"), ctx.params.get("tls_ca")
        ) as farm:
            found = list(words(farm))
    except PnfarmError:
        # a shell that completes has no place for a message
        return []
    return _fitting(found, incomplete)
