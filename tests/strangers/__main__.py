"""``python -m tests.strangers``: an adversary at the API of a farm and of a hub, in turn with times of quiet.

Nothing is to end, no connection of a drive to be lost, nothing to be changed by those who have no right, and honest
clients are to be answered. The engine's ticks are to be at most 1.5 times as late (p99) as without the adversary, or as
those of a minimal loop beside it at the same time: what delays that, too, is the machine. The exit code is 0 if
everything held, 1 if not, 2 for a wrong argument, 4 where the machine permits no namespace.
"""

# ruff: noqa: T201 - what it prints is its answer
# ruff: noqa: E402 - the path of imports comes first

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "tests" / "support"), str(ROOT / "tests" / "faults")]

from pnfarm.errors import EnvironmentError_
from pnfarm.links.kernel.sandbox import enter_sandbox

#: A time of quiet and one of attack, seconds; the attacks under way end within the third.
QUIET, ATTACK, BEHIND = 30.0, 90.0, 60.0
MOST_LATER, SLACK_KB, SLACK_FILES, SLACK_THREADS = 1.5, 15_000, 12, 8
#: What keeps a drive from its data for longer than its watchdog.
STALL_SECONDS = 0.1


def p99(buckets: Counter[float]) -> float:
    """The p99 of how late ticks began, s, inside its bucket by interpolation."""
    from pnfarm.scenario.measures import quantile

    return quantile(0.99, buckets)


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.strangers", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--minutes", type=float, default=60.0, help="how long (default: 60)")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--drives", type=int, default=16, help="1 to 200 (default: 16)")
    parser.add_argument("--fifo", type=int, default=1, help="SCHED_FIFO priority of the engines; 0: none (default: 1)")
    parser.add_argument("--out", type=Path, metavar="FILE", help="what was found, as JSON")
    options = parser.parse_args()
    if not (0 < options.minutes < 1e4 and 1 <= options.drives <= 200 and 0 <= options.fifo <= 99):
        parser.error("--minutes is above 0, --drives 1 to 200, --fifo 0 to 99")
    try:
        enter_sandbox()
    except EnvironmentError_ as exc:
        sys.stderr.write(f"tests.strangers: {exc}\n")
        return 4
    with tempfile.TemporaryDirectory(prefix="pnfarm-strangers-") as folder:
        found = _run(options, Path(folder))
    if options.out is not None:
        options.out.write_text(json.dumps(found, indent=1))
    for sentence in found["wrong"]:
        print(f"wrong: {sentence}")
    print("held" if not found["wrong"] else "did not hold")
    return 1 if found["wrong"] else 0


def _run(options: argparse.Namespace, folder: Path) -> dict[str, Any]:
    from stalls import StallWatch

    from tests.strangers.rig import PORTS, Floor, Honest, Rig

    rig, wrong = Rig(folder, options.drives, options.fifo), []
    late: dict[str, Counter[float]] = {"quiet": Counter(), "attacked": Counter()}
    attacks: dict[str, Counter[str]] = {}
    honest = Honest(rig)
    stalls, floor = StallWatch(), Floor(options.fifo)
    try:
        rig.open()
        # connections are set up to their last phase
        time.sleep(5.0)
        before, connects, begun = {}, rig.connects(), time.monotonic()
        honest.start()
        end, number, lost = begun + options.minutes * 60, 0, Counter({"quiet": 0, "attacked": 0})
        while time.monotonic() < end and not rig.ended():
            mark = rig.late()
            floor.passed("")
            time.sleep(QUIET)
            floor.passed("quiet")
            mark = _add(late["quiet"], mark, rig)
            connects, lost["quiet"] = rig.connects(), lost["quiet"] + rig.connects() - connects
            asked = {"ports": PORTS, "secrets": rig.secrets, "authority": str(rig.authority), "seconds": ATTACK}
            at = time.monotonic()
            for name, counts in _attacked(asked | {"seed": f"{options.seed}/{number}"}).items():
                attacks.setdefault(name, Counter()).update(counts)
            floor.passed("attacked")
            _add(late["attacked"], mark, rig)
            number += 1
            # the most that was open at once, the process keeps; what leaks goes on in the second half
            before = rig.held() if not before or time.monotonic() < (begun + end) / 2 else before
            if (now := rig.connects()) != connects:
                stall = stalls.longest(at)
                print(f"  {now - connects} connections set up anew; the machine's longest stall: {stall:.2f} s")
                for line in rig.losses():
                    print(f"    {line[:400]}")
                # what a stall of the machine took is not the adversary's
                lost["attacked"] += 0 if stall > STALL_SECONDS else now - connects
                connects = now
            shares = {name: f"{p99(buckets) * 1e6:.0f} us" for name, buckets in late.items()}
            print(f"  {(time.monotonic() - begun) / 60:.0f} min: p99 {shares}, honest {len(honest.took)} answered,"
                  f" {len(honest.failed)} not", flush=True)  # fmt: skip
        honest.stop()
        # what attackers left open has ended by then, by the limits of the API
        time.sleep(QUIET / 2)
        wrong += [f"the {name} ended" for name in rig.ended()]
        after = rig.held()
        faults = json.loads(rig.ask("farm", "GET", "/api/v1/faults")[1])["faults"]
        wrong += [f"a fault is there: {fault}" for fault in faults[:3]]
        if rig.back() != options.drives:
            wrong.append(f"{options.drives - rig.back()} drives are not in operation")
    finally:
        codes = rig.close()
        stalls.close()
        least = floor.close()
    wrong += [f"the {name} ended with {code}" for name, code in codes.items() if code != 0]
    wrong += rig.changes()
    wrong += [f"{name}: {count} x {what}" for name, counts in attacks.items() for what, count in counts.items()
              if what.startswith("wrong")]  # fmt: skip
    if lost["attacked"]:
        wrong.append(f"connections of drives were lost: {dict(lost)}")
    attacked, quiet = p99(late["attacked"]), p99(late["quiet"])
    ratio, beside = attacked / quiet, attacked / least["attacked"]
    if min(ratio, beside) > MOST_LATER:
        wrong.append(
            f"lateness p99 is {ratio:.2f} times that without attacks, {beside:.2f} times that of a minimal loop"
        )
    if len(honest.failed) > len(honest.took) / 100:
        wrong.append(f"{len(honest.failed)} honest requests failed, such as {honest.failed[:3]}")
    for name, held in after.items():
        for what, slack in (("memory", SLACK_KB), ("files", SLACK_FILES), ("threads", SLACK_THREADS)):
            if held[what] > before[name][what] + slack:
                wrong.append(f"the {name} holds more {what}: {before[name][what]}, then {held[what]}")
    for side in rig.sides.values():
        errors = [line for line in side.log.last if "Traceback" in line]
        if errors:
            wrong.append(f"the {side.name} logged {len(errors)} tracebacks, the last one: {errors[-1][-300:]}")
    took = sorted(honest.took)
    return {
        "minutes": (time.monotonic() - begun) / 60, "seed": options.seed, "drives": options.drives, "wrong": wrong,
        "attacks": attacks, "lateness_p99_seconds": {name: p99(buckets) for name, buckets in late.items()},
        "lateness_ratio": ratio, "floor_p99_seconds": least, "lateness_over_floor": beside,
        "lost": lost, "held": {"before": before, "after": after},
        "honest": {"answered": len(took), "failed": honest.failed[:100], "p50_seconds": took[len(took) // 2],
                   "p99_seconds": took[len(took) * 99 // 100], "longest_seconds": took[-1]},
    }  # fmt: skip


def _add(total: Counter[float], before: dict[float, float], rig: Any) -> dict[float, float]:
    """Count what has come since; the present counts."""
    now: dict[float, float] = rig.late()
    total.update({edge: count - before.get(edge, 0.0) for edge, count in now.items()})
    return now


def _attacked(asked: dict[str, Any]) -> dict[str, dict[str, int]]:
    command = [sys.executable, "-m", "tests.strangers.attacker"]
    done = subprocess.run(
        command, input=json.dumps(asked), capture_output=True, text=True, cwd=ROOT, timeout=ATTACK + BEHIND, check=False
    )
    if done.returncode:
        raise RuntimeError(f"the attacker ended with {done.returncode}: {done.stderr[-2000:]}")
    return dict(json.loads(done.stdout))


if __name__ == "__main__":
    sys.exit(main())
