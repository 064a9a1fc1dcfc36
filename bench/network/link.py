"""A link between two network namespaces of its own; a process, started by bench.network.hosts.

It holds a TUN device in either namespace and hands each packet from one to the other after a delay:
tc's netem, which would do that, is not in every kernel. It reads delays, s, from its standard
input, a line each, and ends with it; namespaces without a name end with the last process in them.
"""

from __future__ import annotations

import ctypes
import fcntl
import os
import select
import struct
import subprocess
import sys
import time
from collections import deque

ADDRESSES = ("10.0.0.1", "10.0.0.2")
DEVICE = "rbpf_link"

CLONE_NEWNET = 0x40000000
TUN_DEVICE = "/dev/net/tun"
# linux/if_tun.h
TUNSETIFF, TUNSETOFFLOAD = 0x400454CA, 0x400454D0
IFF_TUN, IFF_NO_PI, IFF_VNET_HDR = 0x0001, 0x1000, 0x4000
TUN_F_CSUM, TUN_F_TSO4 = 0x01, 0x02
LARGEST_READ = 10 + 65535  # bytes: struct virtio_net_hdr and a packet
# Packets read from one end before the other end has its turn.
BATCH = 64


def make_end(address: str) -> tuple[int, int]:
    """Moves to a new namespace with one end of the link; that namespace and the end, open files."""
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.unshare(CLONE_NEWNET) != 0:
        raise OSError(ctypes.get_errno(), "unshare(CLONE_NEWNET)")
    end = os.open(TUN_DEVICE, os.O_RDWR | os.O_NONBLOCK)
    flags = IFF_TUN | IFF_NO_PI | IFF_VNET_HDR
    fcntl.ioctl(end, TUNSETIFF, struct.pack("16sH22x", DEVICE.encode(), flags))
    # Segments of up to 64 kB cross the link in one piece, as network cards take them: the fewer
    # packets, the less of the machine is taken from those who are being watched.
    fcntl.ioctl(end, TUNSETOFFLOAD, TUN_F_CSUM | TUN_F_TSO4)
    for what in (f"addr add {address}/24 dev {DEVICE}", f"link set {DEVICE} up", "link set lo up"):
        subprocess.run(["ip", *what.split()], check=True)
    return os.open("/proc/self/ns/net", os.O_RDONLY), end


def carry(ends: tuple[int, int]) -> None:
    """Hand on packets, in their order, until standard input ends."""
    delay_s = 0.0
    under_way: deque[tuple[float, int, bytes]] = deque()  # due, monotonic s; to which end; packet
    other = dict(zip(ends, reversed(ends)))
    while True:
        wait_s = max(0.0, under_way[0][0] - time.monotonic()) if under_way else None
        readable, _, _ = select.select([*ends, sys.stdin], [], [], wait_s)
        if sys.stdin in readable:
            line = sys.stdin.readline()
            if not line:
                return
            delay_s = float(line)
        for end in ends:
            if end in readable:
                due_s = time.monotonic() + delay_s
                under_way.extend((due_s, other[end], packet) for packet in _read(end))
        while under_way and under_way[0][0] <= time.monotonic():
            _, end, packet = under_way.popleft()
            os.write(end, packet)


def _read(end: int) -> list[bytes]:
    packets: list[bytes] = []
    try:
        while len(packets) < BATCH:
            packets.append(os.read(end, LARGEST_READ))
    except BlockingIOError:
        pass
    return packets


if __name__ == "__main__":
    (first, first_end), (second, second_end) = map(make_end, ADDRESSES)
    print(first, second, flush=True)
    carry((first_end, second_end))
