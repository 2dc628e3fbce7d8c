"""Makes the soak's modules importable, by their package's name as ``python -m tests.soak`` has it."""

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tests" / "faults")]
