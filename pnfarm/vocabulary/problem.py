"""A value that is not allowed, in the form of all messages: ``is 3; allowed: a duration such as 2s``."""

from __future__ import annotations

__all__ = ["Problem"]


class Problem(ValueError):  # noqa: N818 - a finding about one value; the reader of the file makes an error of it
    """What is wrong with a value, and what is allowed.

    Validators of pydantic raise it, too; it is then in the context of pydantic's error.
    """

    def __init__(self, what: str, allowed: str = "") -> None:
        super().__init__(f"{what}; allowed: {allowed}" if allowed else what)
        self.what = what
        self.allowed = allowed
