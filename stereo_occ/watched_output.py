"""Standard output and logs that can no longer be written: a full disk, a pipe that nobody reads."""

import logging
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from stereo_occ.system_errors import refusal


@contextmanager
def watched_output(refused: Callable[[str], None]) -> Iterator[None]:
    """Call ``refused`` with one line for each record and each rest of the output that cannot be written.

    The work itself goes on: what it makes is worth more than what it says.
    """

    def note(place: str, error: OSError) -> bool:
        error.filename = place
        problem = refusal(error)
        if problem is not None:
            refused(problem)
        return problem is not None

    def of_log(handler: logging.Handler, record: logging.LogRecord) -> None:
        error = sys.exc_info()[1]
        place = getattr(getattr(handler, "stream", None), "name", "log")
        if not (isinstance(error, OSError) and note(place, error)):
            before(handler, record)

    before, logging.Handler.handleError = logging.Handler.handleError, of_log  # type: ignore[assignment,method-assign]
    try:
        yield
    finally:
        logging.Handler.handleError = before  # type: ignore[method-assign]
        try:
            sys.stdout.flush()
        except OSError as error:
            note("<stdout>", error)
            # Else Python tries once more when it ends, and complains in lines of its own.
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
