"""The verdict over all pieces of a soak, and its page: every number is from the kept file."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Any

from tests.soak.judge import Check
from tests.soak.kept import Kept
from tests.soak.slopes import BOUNDS, TOO_SHORT, WARM_SECONDS, processes, series, slope, slope_check

__all__ = ["failed", "page", "slope_checks", "verdict"]

#: The most of two cores that the default size may take.
MOST_CORES = 1.4
_WORDS = {True: "ok", False: "**FAILED**", None: "not judged"}


def failed(checks: Iterable[Check]) -> bool:
    return any(check.ok is False for check in checks)


def _samples(kept: Kept) -> list[list[dict[str, Any]]]:
    """Of each piece."""
    return [piece["samples"] for piece in kept.pieces]


def slope_checks(kept: Kept) -> list[Check]:
    """One for each program and quantity that samples have."""
    pieces = _samples(kept)
    found = []
    for name in processes(sample for piece in pieces for sample in piece):
        for what in BOUNDS:
            runs = [run for piece in pieces for run in series(piece, name, what)]
            if runs:
                found.append(slope_check(name, what, slope(runs)))
    return found


def _summed(kept: Kept, key: str) -> Counter[str]:
    total: Counter[str] = Counter()
    for piece in kept.pieces:
        total.update(piece.get(key, {}))
    return total


def _longest(kept: Kept) -> dict[str, tuple[float, str, int]]:
    """Of each reason: seconds, station, piece."""
    found: dict[str, tuple[float, str, int]] = {}
    for piece in kept.pieces:
        for why, (seconds, station) in piece.get("returns", {}).items():
            if seconds > found.get(why, (-1.0,))[0]:
                found[why] = seconds, station, piece["number"]
    return dict(sorted(found.items(), key=lambda item: -item[1][0]))


def _of_pieces(kept: Kept) -> list[Check]:
    """Each check over all pieces: failed if it failed in one, ok if it held in every one that judged it."""
    told: dict[str, list[tuple[int, bool | None, str]]] = {}
    for piece in kept.pieces:
        for check in piece["checks"]:
            told.setdefault(check["name"], []).append((piece["number"], check["ok"], check["told"]))
    found = []
    for name, each in told.items():
        bad = [(number, text) for number, ok, text in each if ok is False]
        held = sum(ok is True for _, ok, _ in each)
        text = "; ".join(f"piece {number}: {text}" for number, text in bad[:3]) or f"in {held} of {len(each)} pieces"
        found.append(Check(name, ok=False if bad else True if held else None, told=text))
    return found


def cores(samples: Sequence[dict[str, Any]]) -> dict[str, float]:
    """The part of one core that each program took from the first sample of a piece to the last one."""
    if len(samples) < 2:
        return {}
    first, last = samples[0], samples[-1]
    spent = last["seconds"] - first["seconds"]
    return {
        key.removesuffix(" cpu"): (last[key] - first[key]) / spent
        for key in first
        if key.endswith(" cpu") and key in last and spent
    }


def _load(kept: Kept) -> dict[str, float]:
    """The mean over all pieces, weighted by their time."""
    total: Counter[str] = Counter()
    for piece in kept.pieces:
        for name, part in cores(piece["samples"]).items():
            total[name] += part * piece["seconds"]
    return {name: part / kept.seconds for name, part in total.items()} if kept.seconds else {}


def verdict(kept: Kept) -> list[Check]:
    """Every check of the soak."""
    load = _load(kept)
    checks = [*_of_pieces(kept), *slope_checks(kept)]
    if load and not kept.options["virtual"]:
        used = sum(load.values())
        checks.append(Check("below 70 % of two cores", ok=used <= MOST_CORES, told=f"{used:.2f} cores on average"))
    return checks


def _table(heads: Sequence[str], rows: Iterable[Sequence[object]]) -> list[str]:
    lines = [f"| {' | '.join(heads)} |", f"|{'---|' * len(heads)}"]
    return [*lines, *(f"| {' | '.join(str(cell).replace('|', '/') for cell in row)} |" for row in rows), ""]


def _counts(counter: Counter[str]) -> list[tuple[str, str]]:
    return [(name, f"{count:,}") for name, count in counter.most_common()]


def _actions(counter: Counter[str]) -> list[tuple[str, str, str]]:
    """Each action, how often, and how often each status was the answer: ``fault 201`` is one of ``fault``."""
    times: Counter[str] = Counter()
    answers: dict[str, list[str]] = {}
    for key, count in counter.most_common():
        action, _, status = key.rpartition(" ")
        if status.isdigit():
            answers.setdefault(action, []).append(f"{status}: {count:,}")
            times.setdefault(action, 0)
        else:
            times[key] += count
    return [
        (action, f"{count:,}" if count else "", ", ".join(answers.get(action, ())))
        for action, count in times.most_common()
    ]


def page(kept: Kept) -> str:
    """The report in Markdown."""
    options, pieces, checks = kept.options, kept.pieces, verdict(kept)
    commits = list(dict.fromkeys(piece["commit"] for piece in pieces))
    machines = list(dict.fromkeys(tuple(piece["machine"].items()) for piece in pieces))
    judged = [check for check in checks if check.ok is not None]
    word = "failed" if failed(checks) else "passed" if kept.left == 0 and len(judged) == len(checks) else "so far held"
    lines = [
        "# Soak",
        "",
        (
            "Hours of random faults, power cycles, wrong requests and restarted programs over drives of all models,"
            " devices and a plant. `make soak` runs it, `python -m tests.soak --report docs/soak.md` writes this page"
            " from the numbers that it kept; [CONTRIBUTING](../CONTRIBUTING.md#eight-hours-of-random-faults) says what"
            " each check means."
        ),
        "",
    ]
    lines += _table(
        ("", ""),
        [
            ("verdict", (f"**{word}**: {sum(c.ok is True for c in checks)} checks held,"
             f" {sum(c.ok is False for c in checks)} failed, {len(checks) - len(judged)} not judged")),
            ("time", (f"{kept.seconds / 3600:.2f} of {options['hours']:g} h{' of virtual time' * options['virtual']},"
             f" in {len(pieces)} pieces")),
            ("seed", options["seed"]),
            ("arguments", " ".join(f"`--{name} {options[name]}`" for name in ("drives", "rate", "link"))),
            ("commits", ", ".join(f"{name}" for name in commits) or "none"),
            *(("machine", "{cores} cores, {architecture}, {kernel}, {python}".format(**dict(one))) for one in machines),
        ],
    )  # fmt: skip
    lines += (
        ["A commit with a plus sign had changes that were not committed.", ""]
        if any("+" in name for name in commits)
        else []
    )
    lines += ["## Checks", ""]
    lines += _table(("check", "", ""), [(c.name, _WORDS[c.ok], c.told[:500]) for c in _of_pieces(kept)])
    lines += ["## What grows", ""]
    lines += [
        (
            f"Slopes over all processes, the first {WARM_SECONDS / 60:.0f} minutes of each left out: held if the upper"
            " end of the interval is below what is allowed, failed if its lower end is above."
        ),
        "",
    ]
    slopes = slope_checks(kept)
    known = [check for check in slopes if check.told != TOO_SHORT]
    if known:
        lines += _table(("program: what", "", "per hour"), [(c.name, _WORDS[c.ok], c.told) for c in known])
    if short := [check.name for check in slopes if check.told == TOO_SHORT]:
        lines += [f"Too short to judge: {', '.join(short)}.", ""]
    load = _load(kept)
    lines += ["## Load", "", f"{sum(load.values()):.2f} cores on average."]
    lines += ["", *_table(("program", "cores"), [(name, f"{part:.3f}") for name, part in load.items()])]
    lines += ["## Longest returns", "", "From the end of the reason to the exchange of data."]
    rows = [(why, f"{s:.1f} s", station, number) for why, (s, station, number) in _longest(kept).items()]
    lines += ["", *_table(("reason", "longest", "station", "piece"), rows)]
    lines += ["## Lost connections", "", *_table(("reason", "losses"), _counts(_summed(kept, "losses")))]
    if unexplained := [text for piece in pieces for text in piece.get("unexplained", [])]:
        lines += ["Without a reason:", "", *(f"- {text}" for text in unexplained[:20]), ""]
    lines += ["## What was done", "", *_table(("action", "times", "answers"), _actions(_summed(kept, "actions")))]
    lines += ["## Faults", "", *_table(("kind", "injected"), _counts(_summed(kept, "kinds")))]
    lines += ["## Pieces", ""]
    rows = [
        (p["number"], p["seed"], p["began"], f"{p['seconds'] / 60:.1f} min", p["commit"], p["code"]) for p in pieces
    ]
    lines += _table(("piece", "seed", "began (UTC)", "time", "commit", "exit code"), rows)
    return "\n".join(lines).rstrip("\n") + "\n"
