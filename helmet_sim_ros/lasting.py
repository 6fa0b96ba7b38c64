"""What is made at the start and lives as long as the process is not searched for garbage."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def lasting() -> Iterator[None]:
    """Let nothing that exists after the block be searched for reference cycles, then or later.

    Modules, classes and machine code make a quarter of a million objects. Searching them again and
    again while they grow takes a tenth of the time of a start, and every search later has to go
    through all of them.
    """
    searching = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        if searching:
            gc.enable()
