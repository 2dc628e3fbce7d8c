"""``state`` as a database: telling it from a folder, and showing it without secrets."""

from __future__ import annotations

from urllib.parse import urlsplit

__all__ = ["is_database", "redacted"]

_SCHEMES = ("postgresql://", "postgres://")


def is_database(state: str | None) -> bool:
    """Whether ``state`` of a farm file names a database, not a folder."""
    return state is not None and state.startswith(_SCHEMES)


def redacted(url: str) -> str:
    """A database's URL for people: without password and options."""
    try:
        parts = urlsplit(url)
        hosts = parts.netloc.rpartition("@")[2]
        user = (parts.username or "") if "@" in parts.netloc else ""
    except ValueError:
        return "postgresql://..."
    if url.count("@") > parts.netloc.count("@"):
        # a password with a / or # in it ends the host: what is in front of that is no host
        return "postgresql://..."
    return f"postgresql://{user}{'@' if user else ''}{hosts}{parts.path}"
