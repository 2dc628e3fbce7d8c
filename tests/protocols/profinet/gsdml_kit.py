"""A miniature of a maker's GSDML file, written by hand, with what real ones are made of."""

from pathlib import Path

MINIATURE = Path(__file__).with_name("gsdml_miniature.xml").read_text(encoding="utf-8")
#: Its XML declaration and the opening tag of its root.
HEAD = MINIATURE[: MINIATURE.index("<ProfileHeader>")]
