"""Set-up of logging: structlog's and the libraries' lines go to standard error."""

from __future__ import annotations

import atexit
import logging

import structlog

from pnfarm.cli.log.limit import LineLimit
from pnfarm.cli.log.standard_error import StandardError

__all__ = ["configure"]

#: Frames of a traceback that are written.
MAX_FRAMES = 20

_limits: list[LineLimit] = []


def _replace(limit: LineLimit) -> None:
    """Write what an earlier set-up held back; what this one holds back is written when the program ends."""
    if not _limits:
        atexit.register(_flush)
    _flush()
    _limits[:] = [limit]


def _flush() -> None:
    for limit in _limits:
        limit.flush()


def configure(*, as_json: bool, level: str = "info") -> None:
    """``level`` is ``debug``, ``info``, ``warning`` or ``error``; calling it again replaces the set-up."""
    number: int = getattr(logging, level.upper())
    error = StandardError()
    limit = LineLimit()
    _replace(limit)
    shared: list[structlog.typing.Processor] = [
        structlog.contextvars.merge_contextvars,
        structlog.processors.add_log_level,
        error.tell_lost,
        structlog.processors.TimeStamper(fmt="iso", utc=True) if as_json else _clock,
    ]
    last: list[structlog.typing.Processor]
    if as_json:
        # without the values of local variables: they hold secrets, and whole requests of a peer
        frames = structlog.tracebacks.ExceptionDictTransformer(show_locals=False, max_frames=MAX_FRAMES)
        last = [structlog.processors.ExceptionRenderer(frames), structlog.processors.JSONRenderer(default=str)]
    else:
        plain = structlog.dev.plain_traceback
        console = structlog.dev.ConsoleRenderer(colors=error.isatty(), pad_event_to=30, exception_formatter=plain)
        last = [_printable, console]
    structlog.configure(
        processors=[limit, *shared, *last],
        wrapper_class=structlog.make_filtering_bound_logger(number),
        # one write for each line: sums come from a thread of their own
        logger_factory=structlog.WriteLoggerFactory(error),  # type: ignore[arg-type]  # it writes and flushes, no more
        cache_logger_on_first_use=False,
    )
    handler = logging.StreamHandler(error)
    handler.setFormatter(
        structlog.stdlib.ProcessorFormatter(
            foreign_pre_chain=[*shared, structlog.stdlib.add_logger_name],
            processors=[structlog.stdlib.ProcessorFormatter.remove_processors_meta, *last],
        )
    )
    handler.addFilter(limit)
    root = logging.getLogger()
    root.handlers[:] = [handler]
    # libraries log at "info" what only concerns themselves
    root.setLevel(max(number, logging.WARNING) if number > logging.DEBUG else number)
    logging.captureWarnings(capture=True)


def _printable(_logger: object, _method: str, line: structlog.typing.EventDict) -> structlog.typing.EventDict:
    """What a client or a station named does not steer the operator's terminal."""
    for key, value in line.items():
        if isinstance(value, str) and not value.isprintable() and key not in {"exception", "stack"}:
            line[key] = "".join(one if one.isprintable() else ascii(one)[1:-1] for one in value)
    return line


_clock = structlog.processors.TimeStamper(fmt="%H:%M:%S.%f", utc=False)
