"""Log lines go to standard error, structlog's and the libraries' alike; set up once, by the program's callback."""

from __future__ import annotations

import logging
import sys

import structlog

__all__ = ["configure"]


class _StandardError:
    """Standard error as it is at each line: a live table on the terminal puts itself in its place for a while."""

    def write(self, text: str) -> int:
        return sys.stderr.write(text)

    def flush(self) -> None:
        sys.stderr.flush()

    def isatty(self) -> bool:
        return sys.stderr.isatty()


def configure(*, as_json: bool, level: str = "info") -> None:
    """``level`` is ``debug``, ``info``, ``warning`` or ``error``; calling it again replaces the set-up."""
    number: int = getattr(logging, level.upper())
    error = _StandardError()
    shared: list[structlog.typing.Processor] = [
        structlog.contextvars.merge_contextvars,
        structlog.processors.add_log_level,
        structlog.processors.TimeStamper(fmt="iso", utc=True) if as_json else _clock,
    ]
    last: list[structlog.typing.Processor]
    if as_json:
        last = [structlog.processors.dict_tracebacks, structlog.processors.JSONRenderer(default=str)]
    else:
        last = [structlog.dev.ConsoleRenderer(colors=error.isatty(), pad_event_to=30)]
    structlog.configure(
        processors=[*shared, *last],
        wrapper_class=structlog.make_filtering_bound_logger(number),
        logger_factory=structlog.PrintLoggerFactory(error),  # type: ignore[arg-type]  # it writes and flushes, no more
        cache_logger_on_first_use=False,
    )
    handler = logging.StreamHandler(error)
    handler.setFormatter(
        structlog.stdlib.ProcessorFormatter(
            foreign_pre_chain=[*shared, structlog.stdlib.add_logger_name],
            processors=[structlog.stdlib.ProcessorFormatter.remove_processors_meta, *last],
        )
    )
    root = logging.getLogger()
    root.handlers[:] = [handler]
    # libraries say at "info" what is the farm's own business
    root.setLevel(max(number, logging.WARNING) if number > logging.DEBUG else number)
    logging.captureWarnings(capture=True)


_clock = structlog.processors.TimeStamper(fmt="%H:%M:%S.%f", utc=False)
