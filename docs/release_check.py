"""Whether docs/bench.md may go into a release: ``python docs/release_check.py [DAYS]``, at most so many days old."""

from __future__ import annotations

import re
import sys
from datetime import UTC, date, datetime
from pathlib import Path

PAGE = Path(__file__).resolve().parent / "bench.md"
#: Older figures are those of another program.
DAYS = 30


def complaints(page: str, today: date, days: int = DAYS) -> list[str]:
    """What is wrong with the figures of the page, one sentence each."""
    found = []
    said = re.search(r"printed on (\d{4}-\d{2}-\d{2})", page)
    if said is None:
        found.append("the page does not say when it was measured")
    elif not 0 <= (age := (today - date.fromisoformat(said[1])).days) <= days:
        found.append(f"the figures are of {said[1]}, {age} days old; at most {days} are allowed")
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in page.splitlines() if line[:2] == "| "]
    if len(rows) < 2:
        found.append("the page has no figures")
    found += [f"{row[0]} was measured {row[-1]}" for row in rows[1:] if row[-1].startswith("beside load")]
    return found


def main() -> None:
    """End with 1 if something is wrong."""
    days = int(sys.argv[1]) if len(sys.argv) > 1 else DAYS
    found = complaints(PAGE.read_text(encoding="utf-8"), datetime.now(UTC).date(), days)
    for complaint in found:
        sys.stderr.write(f"{PAGE.name}: {complaint}\n")
    if found:
        sys.stderr.write("Run `make release-check` on a machine that does nothing else.\n")
        raise SystemExit(1)


if __name__ == "__main__":
    main()
