"""The attacks in a process of their own, which takes only the time that others leave: what they cost the farm counts,
not what they cost the machine.

``python -m tests.strangers.attacker < JSON`` goes through all attacks for some seconds, and prints a JSON object: for
each attack its number, statuses, and statuses that are wrong.
"""

from __future__ import annotations

import asyncio
import json
import os
import ssl
import sys
import time
from collections import Counter
from typing import Any

from tests.strangers.attacks import ATTACKS, Target, named

#: Attacks under way at once, on each server.
AT_ONCE = 6


async def _attack(target: Target, end: float, found: dict[str, Counter[str]]) -> None:
    while time.monotonic() < end:
        name = target.rng.choice(sorted(ATTACKS))
        attack, count = ATTACKS[name], found[name]
        count["begun"] += 1
        try:
            statuses = await attack.go(target)
        except (OSError, ssl.SSLError, TimeoutError, EOFError) as exc:
            # the server closes connections of those who begin too many
            count[f"closed ({type(exc).__name__})"] += 1
            continue
        for status in statuses:
            count[named(status)] += 1
            if status not in attack.may:
                count[f"wrong: {named(status)}"] += 1


async def _all(targets: list[Target], seconds: float) -> dict[str, Counter[str]]:
    found: dict[str, Counter[str]] = {name: Counter() for name in ATTACKS}
    end = time.monotonic() + seconds
    await asyncio.gather(*(_attack(target, end, found) for target in targets for _ in range(AT_ONCE)))
    return found


def main() -> int:
    os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))
    asked: dict[str, Any] = json.load(sys.stdin)
    context = ssl.create_default_context(cafile=asked["authority"])
    targets = []
    for number, (name, port) in enumerate(sorted(asked["ports"].items())):
        target = Target(name, port, context, asked["secrets"])
        target.rng.seed(f"{asked['seed']}/{number}")
        targets.append(target)
    json.dump(asyncio.run(_all(targets, asked["seconds"])), sys.stdout)
    return 0


if __name__ == "__main__":
    sys.exit(main())
