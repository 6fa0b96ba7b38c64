"""Ending a process although native code hangs.

Fast DDS 2.14 can wait for ever while a participant is destroyed:
``DomainParticipant::set_listener`` holds a mutex and spins until its own discovery thread is done,
and that thread waits for the mutex. It takes a discovery message of another process in the same
moment, as when several nodes end together. The interpreter lock is held meanwhile, so no Python
thread or signal handler could help.
"""

from __future__ import annotations

import ctypes
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress

_SIGEV_THREAD = 2


class _Event(ctypes.Structure):
    """``struct sigevent`` of glibc on 64-bit machines."""

    _fields_ = (
        ("value", ctypes.c_void_p),
        ("signal", ctypes.c_int),
        ("notify", ctypes.c_int),
        ("function", ctypes.c_void_p),
        ("attributes", ctypes.c_void_p),
        ("_rest", ctypes.c_char * 32),
    )


class _Times(ctypes.Structure):
    """``struct itimerspec``: interval and first expiry."""

    _fields_ = (("interval", ctypes.c_long * 2), ("first", ctypes.c_long * 2))


@contextmanager
def ending_anyway(code: int, seconds: float) -> Iterator[None]:
    """End the process with an exit code if the block takes longer than some seconds.

    A timer of the C library does it from a thread of its own, without the interpreter. Only where
    there is such a timer (Linux); elsewhere the block just runs.
    """
    if not sys.platform.startswith("linux") or ctypes.sizeof(ctypes.c_void_p) != 8:
        yield
        return
    for stream in (sys.stdout, sys.stderr):
        with suppress(AttributeError, OSError, ValueError):  # none, or closed at its other end
            stream.flush()
    libc = ctypes.CDLL(None)
    leave = ctypes.cast(libc._exit, ctypes.c_void_p).value
    event = _Event(value=code, notify=_SIGEV_THREAD, function=leave)
    whole, rest = divmod(seconds, 1.0)
    times = _Times(first=(int(whole), int(rest * 1e9)))
    timer = ctypes.c_void_p()
    if libc.timer_create(time.CLOCK_MONOTONIC, ctypes.byref(event), ctypes.byref(timer)) != 0:
        yield
        return
    libc.timer_settime(timer, 0, ctypes.byref(times), None)
    try:
        yield
    finally:
        libc.timer_delete(timer)
