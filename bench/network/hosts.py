"""Two hosts in one machine, for what must be seen to work between hosts."""

from __future__ import annotations

import contextlib
import ctypes
import os
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Iterator

from bench.network.link import ADDRESSES, CLONE_NEWNET, DEVICE, TUN_DEVICE
from bench.paths import ROOT

MASTER_PORT = 11311


@dataclass(frozen=True)
class Host:
    """A network namespace with an address on the link; files and processes are the machine's."""

    address: str
    namespace: str  # a file
    master_uri: str  # on the first host

    def environment(self) -> dict[str, str]:
        """What ROS needs to know on this host: ROS_MASTER_URI and ROS_IP, nothing else."""
        environment = {name: value for name, value in os.environ.items() if name != "ROS_HOSTNAME"}
        return environment | {"ROS_MASTER_URI": self.master_uri, "ROS_IP": self.address}

    def command(self, *words: str | Path) -> list[str]:
        """A command's words, for a process on this host; to be used with `environment`.

        The process is interrupted when its parent ends, so that a test that is killed leaves
        nothing behind.
        """
        prefix = ["setpriv", "--pdeathsig", "INT", "nsenter", f"--net={self.namespace}"]
        return [*prefix, *map(str, words)]

    def enter(self) -> None:
        """Move this process to this host, for good; before it starts threads and imports rospy."""
        libc = ctypes.CDLL(None, use_errno=True)
        with open(self.namespace) as namespace:
            if libc.setns(namespace.fileno(), CLONE_NEWNET) != 0:
                raise OSError(ctypes.get_errno(), "setns")
        os.environ.pop("ROS_HOSTNAME", None)
        os.environ.update(self.environment())


class Link:
    """What joins the hosts."""

    def __init__(self, process: subprocess.Popen) -> None:
        self._process = process

    def set_delay(self, delay_s: float) -> None:
        """Time that each packet takes from now on, one way."""
        self._process.stdin.write(f"{delay_s}\n")
        self._process.stdin.flush()

    @property
    def pid(self) -> int:
        return self._process.pid


def impediment() -> str:
    """Why this machine cannot play two hosts; empty if it can."""
    if os.geteuid() != 0:
        return "network namespaces need root"
    if not os.access(TUN_DEVICE, os.R_OK | os.W_OK):
        return f"no {TUN_DEVICE}"
    for tool in ("ip", "nsenter", "setpriv"):
        if shutil.which(tool) is None:
            return f"no command {tool}"
    if subprocess.run(["unshare", "--net", "true"], capture_output=True).returncode != 0:
        return "network namespaces are not allowed here"
    return ""


@contextlib.contextmanager
def two_hosts(delay_s: float) -> Iterator[tuple[Host, Host, Link]]:
    """Two hosts, and the link between them with a delay for each way."""
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    command = [sys.executable, "-m", "bench.network.link"]
    with subprocess.Popen(command, cwd=ROOT, **pipes) as process:
        try:
            namespaces = process.stdout.readline().split()
            if len(namespaces) != 2:
                raise RuntimeError("the link between the hosts did not start; see above")
            link = Link(process)
            link.set_delay(delay_s)
            master_uri = f"http://{ADDRESSES[0]}:{MASTER_PORT}"
            first, second = (
                Host(address, f"/proc/{process.pid}/fd/{namespace}", master_uri)
                for address, namespace in zip(ADDRESSES, namespaces)
            )
            yield first, second, link
        finally:
            process.stdin.close()


def bytes_over_link() -> int:
    """Bytes that have crossed the link, both ways, as seen by a process that has entered a host."""
    for line in Path("/proc/self/net/dev").read_text().splitlines():
        name, _, counters = line.partition(":")
        if name.strip() == DEVICE:
            fields = counters.split()  # eight of what was received, eight of what was sent
            return int(fields[0]) + int(fields[8])
    raise RuntimeError(f"no device {DEVICE}: this process is on no host")
