"""``python -m tests.fuzz``: random and changed input for every parser and every protocol machine, offline.

A parser may return a value or raise DecodeError; a machine may do neither harm nor raise. Every input has a bound of
processor time, and the process a bound of memory. A failure is printed with its octets and the command that repeats it;
the exit code is 1 then, 2 for a wrong argument.
"""

# ruff: noqa: T201 - what it prints is its answer
# ruff: noqa: E402 - the path of imports comes first

from __future__ import annotations

import argparse
import gc
import os
import sys
import time
import traceback
from collections import Counter
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from math import ceil
from pathlib import Path
from random import Random
from typing import NoReturn

import numba

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "tests" / name) for name in ("support", "faults", "protocols/enip", "interop")]

from tests.fuzz import campaign, differential, engine, guided, running, storms
from tests.fuzz.corpus import gather
from tests.fuzz.machines import MACHINES
from tests.fuzz.machines_enip import ENIP, enip_layers
from tests.fuzz.machines_more import MORE
from tests.fuzz.targets import parsers
from tests.fuzz.watch import FailureFoundError, resident

#: Processor time that one input may take; the longest are a thousand times below.
PARSER_SECONDS = 0.25
MACHINE_SECONDS = 1.0
#: What the process may grow after every target's first turn.
GROWTH_BYTES = 64 * 1024 * 1024
#: Inputs of one turn.
PARSER_TURN, MACHINE_TURN = 1500, 4000
REPORT_SECONDS = 10.0


@dataclass
class Tally:
    """What one target did with its inputs."""

    inputs: int = 0
    outcomes: Counter[str] = field(default_factory=Counter)
    longest_ns: int = 0
    total_ns: int = 0


class Run:
    def __init__(self, options: argparse.Namespace) -> None:
        self.options = options
        self.tallies: dict[str, Tally] = {}
        self.done = 0
        self.began = time.monotonic()
        self.reported = self.began
        self.memory: int | None = None
        corpus = gather()
        self.own, self.captured = len(corpus.to_drive) + len(corpus.to_controller), len(corpus.captured)
        self.layers = {**corpus.layers, **enip_layers()}
        # else a collection of all that the corpus left, 0.1 s, falls into the time of one input
        gc.collect()
        gc.freeze()
        wanted = options.target
        self.parsers = [parser for parser in parsers(self.layers) if fnmatchcase(parser.name, wanted)]
        self.machines = [machine for machine in (*MACHINES, *MORE, *ENIP) if fnmatchcase(machine.name, wanted)]

    # -- turns -------------------------------------------------------------------------------------------------------

    def rng(self, name: str, chunk: int) -> Random:
        return Random(f"{self.options.seed}/{name}/{chunk}")

    def parser_turn(self, parser, chunk, inputs):
        rng = self.rng(parser.name, chunk)
        self.turn(parser.name, chunk, inputs, PARSER_SECONDS, lambda: parser.next_input(rng), parser.feed, repeats=2)

    def machine_turn(self, kind, chunk, inputs):
        rng = self.rng(kind.name, chunk)
        machine = kind(rng, self.layers)
        self.turn(
            kind.name,
            chunk,
            inputs,
            MACHINE_SECONDS,
            lambda: machine.prepared_input(rng),
            lambda data: machine.feed(rng, data),
        )

    def turn(self, name, chunk, inputs, limit, make, feed, repeats=0):
        """``repeats``: how often an input that took too long is given again; a machine's state allows none."""
        tally = self.tallies.setdefault(name, Tally())
        clock = time.thread_time_ns
        for number in range(inputs):
            data = b""
            try:
                data = make()
                start = clock()
                outcome = feed(data)
                took = clock() - start
                for _ in range(repeats):
                    if took <= limit * 1e9:
                        break
                    # on a virtual machine, time taken by others counts as the thread's own
                    start = clock()
                    feed(data)
                    took = min(took, clock() - start)
            except Exception as exc:  # noqa: BLE001 - whatever it is, it is the finding
                self.failed(name, chunk, number, data, exc)
            if took > limit * 1e9:
                self.failed(name, chunk, number, data, FailureFoundError(f"took {took / 1e9:.3f} s of processor time"))
            tally.outcomes[outcome] += 1
            tally.longest_ns = max(tally.longest_ns, took)
            tally.total_ns += took
        tally.inputs += inputs
        self.done += inputs

    def failed(self, name, chunk, number, data, exc) -> NoReturn:
        """A machine may also fail without input, while time passes."""
        seed = self.options.seed
        print(f"\n{name} failed on input {number} of turn {chunk} (seed {seed}):", file=sys.stderr)
        traceback.print_exception(exc, file=sys.stderr)
        print(f"input, {len(data)} octets: {data.hex()}", file=sys.stderr)
        again = f"python -m tests.fuzz --target '{name}' --seed {seed} --turn {chunk} --count {number + 1}"
        print(f"again: {again}", file=sys.stderr)
        raise FailureFoundError(name) from exc

    # -- the whole ---------------------------------------------------------------------------------------------------

    def go(self) -> None:
        options = self.options
        strings = sum(map(len, self.layers.values()))
        print(
            f"{len(self.parsers)} parsers, {len(self.machines)} machines; {self.own} own frames,"
            f" {self.captured} captured, {strings} octet strings of {len(self.layers)} layers;"
            f" seed {options.seed}"
        )
        if options.turn is not None:
            self.one_round(options.turn, options.count, options.count)
            return
        size = len(self.parsers) * PARSER_TURN + len(self.machines) * MACHINE_TURN
        scale = min(1.0, options.count / size)
        for chunk in range(ceil(options.count / size)):
            self.one_round(chunk, ceil(PARSER_TURN * scale), ceil(MACHINE_TURN * scale))
            if self.out_of_time():
                return
            self.check_memory(chunk)

    def one_round(self, chunk, parser_inputs, machine_inputs):
        for parser in self.parsers:
            self.parser_turn(parser, chunk, parser_inputs)
            if self.between():
                return
        for machine in self.machines:
            self.machine_turn(machine, chunk, machine_inputs)
            if self.between():
                return

    def between(self) -> bool:
        """Progress and memory; true when it is time to stop."""
        now = time.monotonic()
        if now - self.reported > REPORT_SECONDS:
            self.reported = now
            rate = self.done / (now - self.began)
            print(f"{self.done:>10} inputs, {rate:,.0f} a second, {resident() >> 20} MiB", file=sys.stderr, flush=True)
        return self.out_of_time()

    def out_of_time(self) -> bool:
        seconds = self.options.seconds
        return seconds is not None and time.monotonic() - self.began > seconds

    def check_memory(self, chunk: int) -> None:
        """Memory is flat once every target had its first turn."""
        if self.memory is None:
            self.memory = resident()
        elif resident() - self.memory > GROWTH_BYTES:
            raise FailureFoundError(f"memory grew from {self.memory >> 20} to {resident() >> 20} MiB by turn {chunk}")

    def table(self) -> None:
        width = max(len(name) for name in self.tallies)
        print(f"\n{'target':{width}} {'inputs':>8} {'accepted':>8} {'mean us':>8} {'max us':>9}  otherwise")
        for name, tally in self.tallies.items():
            good = tally.outcomes["ok"] + tally.outcomes["answered"]
            reasons = ", ".join(f"{r} {n}" for r, n in tally.outcomes.most_common(6) if r not in {"ok", "answered"})
            mean = tally.total_ns / max(1, tally.inputs) / 1e3
            print(f"{name:{width}} {tally.inputs:>8} {good:>8} {mean:>8.1f} {tally.longest_ns / 1e3:>9.0f}  {reasons}")
        seconds = time.monotonic() - self.began
        grown = (
            "" if self.memory is None else f", {(resident() - self.memory) >> 10} KiB more than after the first turns"
        )
        print(f"\n{self.done} inputs in {seconds:.0f} s; {resident() >> 20} MiB{grown}; nothing but DecodeError")


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=1_000_000, help="inputs, about (default %(default)s)")
    parser.add_argument("--seconds", type=float, help="stop after so long, whatever the count")
    parser.add_argument("--seed", type=int, default=1, help="another seed, other inputs (default %(default)s)")
    parser.add_argument("--target", default="*", help="glob over the targets' names")
    parser.add_argument("--turn", type=int, help="this turn of each target alone, to repeat a failure")
    parser.add_argument("--list", action="store_true", help="name the targets and stop")
    parser.add_argument("--guided", action="store_true", help="guided by coverage; needs atheris")
    parser.add_argument("--engine", action="store_true", help="changed cyclic frames for the compiled engine")
    against = "compare with another implementation, by layer; may be given more than once"
    parser.add_argument("--against", choices=differential.PEERS, action="append", help=against)
    parser.add_argument("--opener", metavar="PATH", help="with --against opener: its program")
    parser.add_argument("--pnet", metavar="PATH", help="with --against pnet: its sample's program pn_dev")
    parser.add_argument("--pnet-gsdml", metavar="PATH", help="with --against pnet: its sample's GSDML file")
    parser.add_argument("--state", help="with --guided: go on with the campaign of this file, until stopped")
    parser.add_argument("--table", action="store_true", help="what the campaign of --state did so far, and stop")
    farm = parser.add_argument_group("a running farm", "A hostile station beside a farm and its controller at work.")
    farm.add_argument("--running", action="store_true", help="this, instead of parsers and machines one by one")
    farm.add_argument("--storms", action="store_true", help="storms of random faults instead, each with a reset")
    farm.add_argument(
        "--minutes", type=float, default=10.0, help="how long, of each target with --guided (default %(default)s)"
    )
    farm.add_argument("--drives", type=int, default=4, help="drives of the farm (default %(default)s)")
    farm.add_argument("--mode", choices=("both", "stranger", "impostor"), default="both", help="who is hostile")
    farm.add_argument("--shots", type=int, default=100_000, help="of one episode (default %(default)s)")
    farm.add_argument("--episode", type=int, help="this one alone, to repeat a failure")
    return parser.parse_args()


def main() -> int:
    options = arguments()
    if options.against:
        return differential.main(options)
    if options.table:
        print(campaign.table(campaign.State.read(Path(options.state))))
        return 0
    if options.guided:
        return guided.main(options)
    if options.engine:
        if not numba.config.BOUNDSCHECK:
            os.environ["NUMBA_BOUNDSCHECK"] = "1"
            os.execv(sys.executable, [sys.executable, "-m", "tests.fuzz", *sys.argv[1:]])
        return engine.main(options)
    if options.running:
        return running.main(options)
    if options.storms:
        return storms.main(options)
    names = [target.name for target in (*parsers({"block": []}), *MACHINES, *MORE, *ENIP)]
    wanted = [name for name in names if fnmatchcase(name, options.target)]
    if not wanted:
        print(f"no target is named {options.target!r}; --list names them", file=sys.stderr)
        return 2
    if options.list:
        print("\n".join(wanted))
        return 0
    run = Run(options)
    try:
        run.go()
    except FailureFoundError as exc:
        print(f"failed: {exc}", file=sys.stderr)
        return 1
    run.table()
    return 0


if __name__ == "__main__":
    sys.exit(main())
