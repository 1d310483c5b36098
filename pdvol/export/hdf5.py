"""Shared by the formats with HDF5 data: the reason why a file could not be written."""

import errno
import os

LONGEST_HDF5_REASON = 160  # characters of HDF5's own message that fit into one line


def failure_reason(error: Exception) -> str:
    """Why HDF5 could not write, in the operating system's words where the error quotes them."""
    if isinstance(error, OSError) and error.strerror:
        return error.strerror
    text = " ".join(str(error).split())
    quoted = (os.strerror(number) for number in (errno.ENOSPC, errno.EFBIG, errno.EDQUOT))
    return next((reason for reason in quoted if reason in text), text[:LONGEST_HDF5_REASON])
