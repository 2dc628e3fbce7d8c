"""Tables of the generated pages."""

from __future__ import annotations

__all__ = ["cell"]


def cell(text: object) -> str:
    """A text in Markdown, on one line."""
    return " ".join(str(text).split()).replace("|", "\\|")
