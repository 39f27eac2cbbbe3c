"""A link between two network namespaces that drops packets; in the kernel's own TCP, no proxy.

`python -m tests.soak.lossy` forwards between two TUN devices, one in each namespace, and obeys
lines on its standard input: ``loss 0.3``, ``silent``. Needs root and /dev/net/tun. It stands for
`tc netem`, which kernels without the module `sch_netem` do not have.
"""

import ctypes
import fcntl
import os
import random
import select
import struct
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

PLANT, WATCHER = "rulec-soak-plant", "rulec-soak-watch"
HOST, OURS = "10.99.7.1", "10.99.7.2"
TUNSETIFF, IFF_TUN, IFF_NO_PI = 0x400454CA, 0x0001, 0x1000
CLONE_NEWNET = 0x40000000


class Link:
    """The forwarding process."""

    def __init__(self) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-m", "tests.soak.lossy"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        assert self._process.stdout is not None
        assert self._process.stdout.readline() == "up\n"

    def says(self, line: str) -> None:
        """Its next word: how packets fare from now on."""
        assert self._process.stdin is not None
        self._process.stdin.write(line + "\n")
        self._process.stdin.flush()

    def close(self) -> tuple[int, int]:
        """Packets that came, and those that were dropped."""
        seen, _ = self._process.communicate("")
        came, dropped = seen.split()
        return int(came), int(dropped)


def inside(space: str) -> tuple[str, ...]:
    """Words before a command that runs in a namespace."""
    return ("ip", "netns", "exec", space)


@contextmanager
def spaces() -> Iterator[bool]:
    """Two namespaces; whether this machine has such."""
    made = []
    try:
        for space in (PLANT, WATCHER):
            subprocess.run(["ip", "netns", "add", space], check=True, capture_output=True)
            made.append(space)
        yield os.path.exists("/dev/net/tun")
    except (OSError, subprocess.CalledProcessError):
        yield False
    finally:
        for space in made:
            subprocess.run(["ip", "netns", "del", space], check=False)


def _device(space: str, own: str, other: str) -> int:
    """A TUN device in a namespace, up, with an address."""
    libc = ctypes.CDLL(None, use_errno=True)
    with open(f"/run/netns/{space}") as entered:
        if libc.setns(entered.fileno(), CLONE_NEWNET):
            raise OSError(ctypes.get_errno(), f"namespace {space}")
    tun = os.open("/dev/net/tun", os.O_RDWR)
    fcntl.ioctl(tun, TUNSETIFF, struct.pack("16sH", b"soak", IFF_TUN | IFF_NO_PI))
    for words in (f"addr add {own} peer {other} dev soak", "link set soak up", "link set lo up"):
        subprocess.run(["ip", *words.split()], check=True)
    return tun


def main() -> None:
    """Forward until the standard input ends."""
    draw = random.Random(4)
    plant, watcher = _device(PLANT, HOST, OURS), _device(WATCHER, OURS, HOST)
    loss, came, dropped = 0.0, 0, 0
    print("up", flush=True)
    while True:
        for ready in select.select([plant, watcher, sys.stdin.fileno()], [], [])[0]:
            if ready == sys.stdin.fileno():
                words = os.read(ready, 1000).decode().split()
                if not words:
                    print(came, dropped)
                    return
                loss = 1.0 if words[-1] == "silent" else float(words[-1])
                continue
            packet = os.read(ready, 65536)
            came += 1
            if draw.random() < loss:
                dropped += 1
                continue
            os.write(plant if ready == watcher else watcher, packet)


if __name__ == "__main__":
    main()
