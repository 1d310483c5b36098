"""Shared by formats that a library writes: the reason why a file could not be written."""

import errno
import os

LONGEST_REASON = 160  # characters of a library's own message that fit into one line


def failure_reason(error: Exception) -> str:
    """Why a library could not write, in the operating system's words where its error quotes them."""
    if isinstance(error, OSError) and error.strerror:
        return error.strerror
    text = " ".join(str(error).split())
    quoted = (os.strerror(number) for number in (errno.ENOSPC, errno.EFBIG, errno.EDQUOT))
    return next((reason for reason in quoted if reason in text), text[:LONGEST_REASON])
