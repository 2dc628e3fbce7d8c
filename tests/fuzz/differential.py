"""``--against PEER``: the same octets for our parsers and for another implementation, and where their answers differ.

The octets are good ones, each once, and changed ones by seed.  Differences are grouped by layer and kind.
``known_differences.toml`` holds the groups that are known, each with its reason; any other makes the exit code 1 and is
printed with its shortest input.
"""

# ruff: noqa: T201 - what it prints is its answer

from __future__ import annotations

import argparse
import importlib
import sys
import time
import tomllib
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from fnmatch import fnmatchcase
from pathlib import Path
from random import Random

from tests.fuzz.corpus import gather
from tests.fuzz.layers import LAYERS, Answer, Layer, ours
from tests.fuzz.machines_enip import enip_layers
from tests.fuzz.mutate import mutated

__all__ = ["PEERS", "differences", "known", "main"]

PEERS = ("scapy", "tshark")
KNOWN = Path(__file__).with_name("known_differences.toml")
#: No input of a frame is longer.
LONGEST = 1500


def known(peer: str) -> dict[str, str]:
    """Reasons by group; a group is a pattern as of file names."""
    return dict(tomllib.loads(KNOWN.read_text("utf-8"))[peer])


def inputs(layer: Layer, layers: Mapping[str, Sequence[bytes]], seed: object, count: int) -> list[bytes]:
    """``count`` inputs: good ones first, each once, and changed ones."""
    pool = [octets for octets in layer.pool(layers) if len(octets) <= LONGEST]
    rng = Random(f"{seed}/{layer.name}")
    found = rng.sample(pool, min(len(pool), max(1, count // 4)))
    return found + [mutated(rng, rng.choice(pool), pool)[:LONGEST] for _ in range(count - len(found))]


def differences(mine: Answer, theirs: Answer) -> Iterator[str]:
    """The kinds of difference between two answers; none where both refuse, or read the same."""
    if isinstance(mine, str):
        if not isinstance(theirs, str):
            yield f"we refuse ({mine})"
        return
    if isinstance(theirs, str):
        yield f"they refuse ({theirs})"
        return
    for field, value in mine.items():
        other = theirs.get(field)
        if value is not None and other is not None and value != other:
            yield f"{field} {'absent' if other == 'absent' else 'differs'}"


def main(options: argparse.Namespace) -> int:
    """1 where a difference is not known, 2 for a layer that is none, 4 where the peer is not installed."""
    try:
        peer = importlib.import_module(f"tests.fuzz.against_{options.against}")
        told = peer.version()
    except (ImportError, FileNotFoundError) as exc:
        print(f"tests.fuzz: --against {options.against}: {exc}", file=sys.stderr)
        return 4
    names = [name for name in LAYERS if name in peer.LAYERS and fnmatchcase(name, options.target)]
    if not names:
        print(f"no layer is named {options.target!r}; there are {', '.join(peer.LAYERS)}", file=sys.stderr)
        return 2
    reasons = known(options.against)
    layers = {**gather().layers, **enip_layers()}
    print(f"{told}; seed {options.seed}")
    print(f"{'layer':10} {'inputs':>8} {'read alike':>10} {'both refuse':>11} {'differ':>8} {'inputs a second':>15}")
    groups: dict[str, tuple[int, bytes, Answer, Answer]] = {}
    for name in names:
        began = time.monotonic()
        layer = LAYERS[name]
        given = inputs(layer, layers, options.seed, max(1, options.count // len(names)))
        tally: Counter[str] = Counter()
        for data, theirs in zip(given, peer.answers(name, given), strict=True):
            mine = ours(layer, data)
            kinds = list(differences(mine, theirs))
            tally["differ" if kinds else "refused" if isinstance(mine, str) else "read"] += 1
            for kind in kinds:
                count, shortest, *rest = groups.get(f"{name}: {kind}", (0, data, mine, theirs))
                if len(data) < len(shortest):
                    shortest, rest = data, [mine, theirs]
                groups[f"{name}: {kind}"] = (count + 1, shortest, *rest)
        rate = len(given) / (time.monotonic() - began)
        print(
            f"{name:10} {len(given):>8} {tally['read']:>10} {tally['refused']:>11} {tally['differ']:>8} {rate:>15,.0f}"
        )
    new = 0
    for group, (count, shortest, mine, theirs) in sorted(groups.items()):
        reason = next((text for pattern, text in reasons.items() if fnmatchcase(group, pattern)), None)
        print(f"{count:>8}  {group}: {reason or 'NEW'}")
        if reason is None:
            new += 1
            print(f"          input: {shortest.hex()}\n          ours:   {mine}\n          theirs: {theirs}")
    print(f"{sum(count for count, *_ in groups.values())} differences in {len(groups)} groups, {new} of them new")
    return int(new > 0)
