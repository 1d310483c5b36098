"""Who can reach a server of this machine."""

import ipaddress
from pathlib import Path

LISTENS = "0A"  # the kernel's number of the state of a socket that waits for connections


def listening_addresses(port: int) -> set[str]:
    """The addresses at which sockets of this machine wait for connections to a port; `0.0.0.0` and `::` are all."""
    found = set()
    for table in ("tcp", "tcp6"):
        path = Path("/proc/net") / table
        for line in path.read_text().splitlines()[1:] if path.exists() else []:
            local, state = line.split()[1], line.split()[3]
            digits, _, number = local.partition(":")
            if state == LISTENS and int(number, 16) == port:
                words = [bytes.fromhex(digits[i : i + 8])[::-1] for i in range(0, len(digits), 8)]
                found.add(str(ipaddress.ip_address(b"".join(words))))
    return found
