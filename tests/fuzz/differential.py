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
import traceback
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from functools import cache, partial
from pathlib import Path
from random import Random
from typing import Any

from tests.fuzz.corpus import gather
from tests.fuzz.layers import LAYERS, Answer, Layer, ours
from tests.fuzz.machines_enip import enip_layers
from tests.fuzz.mutate import mutated

__all__ = ["PEERS", "Groups", "differences", "known", "main"]

PEERS = ("scapy", "tshark", "opener", "pnet")
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
    for name, value in mine.items():
        other = theirs.get(name)
        if value is not None and other is not None and value != other:
            yield f"{name} {'absent' if other == 'absent' else 'differs'}"


@dataclass
class Groups:
    """Differences by group: how many, and the shortest input of each with both answers."""

    found: dict[str, tuple[int, bytes, object, object, str]] = field(default_factory=dict)

    def add(self, group: str, data: bytes, mine: object, theirs: object, again: str = "") -> None:
        """``again``: the arguments that repeat it, where the input alone does not."""
        count, *shortest = self.found.get(group, (0, data, mine, theirs, again))
        self.found[group] = (count + 1, *min(shortest, (data, mine, theirs, again), key=lambda one: len(one[0])))

    def report(self, reasons: Mapping[str, str]) -> int:
        """Print them all, those without a reason with an example; 1 if there is such a one."""
        new = 0
        for group, (count, shortest, mine, theirs, again) in sorted(self.found.items()):
            reason = next((text for pattern, text in reasons.items() if fnmatchcase(group, pattern)), None)
            print(f"{count:>8}  {group}: {reason or 'NEW'}")
            if reason is None:
                new += 1
                print(f"          input:  {shortest.hex()}\n          ours:   {mine}\n          theirs: {theirs}")
                print(f"          again:  {again}\n" if again else "", end="")
        count = sum(count for count, *_ in self.found.values())
        print(f"{count} differences in {len(self.found)} groups, {new} of them new")
        return int(new > 0)


def main(options: argparse.Namespace) -> int:
    """The worst of all peers: 1 where a difference is not known, 2 for a wrong argument, 4 for a missing peer."""
    return max(_PROGRAMS.get(name, _layers)(options, name) for name in options.against)


@cache
def _corpus() -> Mapping[str, Sequence[bytes]]:
    return {**gather().layers, **enip_layers()}


def _layers(options: argparse.Namespace, against: str) -> int:
    """Octets for parsers."""
    try:
        peer = importlib.import_module(f"tests.fuzz.against_{against}")
        told = peer.version()
    except (ImportError, FileNotFoundError) as exc:
        print(f"tests.fuzz: --against {against}: {exc}", file=sys.stderr)
        return 4
    names = [name for name in LAYERS if name in peer.LAYERS and fnmatchcase(name, options.target)]
    if not names:
        print(f"no layer is named {options.target!r}; there are {', '.join(peer.LAYERS)}", file=sys.stderr)
        return 2
    print(f"{told}; seed {options.seed}")
    print(f"{'layer':10} {'inputs':>8} {'read alike':>10} {'both refuse':>11} {'differ':>8} {'inputs a second':>15}")
    groups = Groups()
    for name in names:
        began = time.monotonic()
        layer = LAYERS[name]
        given = inputs(layer, _corpus(), options.seed, max(1, options.count // len(names)))
        tally: Counter[str] = Counter()
        for data, theirs in zip(given, peer.answers(name, given), strict=True):
            mine = ours(layer, data)
            kinds = list(differences(mine, theirs))
            tally["differ" if kinds else "refused" if isinstance(mine, str) else "read"] += 1
            for kind in kinds:
                groups.add(f"{name}: {kind}", data, mine, theirs)
        rate = len(given) / (time.monotonic() - began)
        print(
            f"{name:10} {len(given):>8} {tally['read']:>10} {tally['refused']:>11} {tally['differ']:>8} {rate:>15,.0f}"
        )
    return groups.report(known(against))


def _file(options: argparse.Namespace, peer: str, option: str, what: str) -> Path | None:
    """The file that an option names, or None with a complaint."""
    given = getattr(options, option.replace("-", "_"))
    if given is not None and Path(given).is_file():
        return Path(given)
    print(f"tests.fuzz: --against {peer} needs --{option} PATH, {what}", file=sys.stderr)
    return None


def _behaviour(
    options: argparse.Namespace, peer: str, ours: Any, rig: Any, sequence: Callable[[int], list[Any]], compared: Any
) -> int:
    """Sequences of messages for our protocol machine and for the other program, which ``rig`` runs."""
    groups, messages, alike, done = Groups(), 0, 0, 0
    numbers = range(options.count) if options.turn is None else range(options.turn, options.turn + 1)
    began = time.monotonic()
    with rig as theirs:
        for number in numbers:
            if options.seconds is not None and time.monotonic() - began > options.seconds:
                break
            sent = sequence(number)
            again = f"--against {peer} --seed {options.seed} --turn {number}"
            try:
                mine = ours.answers(sent)
            except Exception:  # noqa: BLE001 - whatever it is, it is the finding
                traceback.print_exc()
                print(
                    *(f"{one.what}: {one.octets.hex()}" for one in sent), f"again: {again}", sep="\n", file=sys.stderr
                )
                return 1
            for one, our_class, their_class in compared(sent, mine, theirs.answers(sent)):
                messages += 1
                alike += our_class == their_class
                if our_class != their_class:
                    group = f"{one.what}: ours {our_class}; theirs {their_class}"
                    groups.add(group, one.octets, our_class, their_class, again)
            done += 1
        more = theirs.told()
    rate = messages / (time.monotonic() - began)
    print(f"{done} sequences, {messages} messages, {rate:,.0f} a second; {alike} answered alike{more}")
    return groups.report(known(peer))


def _opener(options: argparse.Namespace, peer: str) -> int:
    """Sequences of messages, for a built program of OpENer."""
    from tests.fuzz.against_opener import OpenerRig, Ours, compared
    from tests.fuzz.enip_sequences import sequence

    if (program := _file(options, peer, "opener", "its built program")) is None:
        return 2
    return _behaviour(options, peer, Ours(), OpenerRig(program), partial(sequence, options.seed), compared)


def _pnet(options: argparse.Namespace, peer: str) -> int:
    """The same for a built sample application of p-net."""
    from tests.fuzz.pnet.base import planned
    from tests.fuzz.pnet.rig import Ours, PnetRig, compared, farm_text
    from tests.fuzz.pnet.sequences import sequence

    program = _file(options, peer, "pnet", "its built program pn_dev")
    gsdml = _file(options, peer, "pnet-gsdml", "its GSDML file")
    if program is None or gsdml is None:
        return 2
    device = planned(gsdml)
    ours, rig = Ours(device, farm_text(gsdml)), PnetRig(program, device)
    return _behaviour(options, peer, ours, rig, partial(sequence, device, options.seed), compared)


#: Those that are about behaviour; the others read octets.
_PROGRAMS = {"opener": _opener, "pnet": _pnet}
