"""A pair of virtual network interfaces joined like by a cable, in a network namespace that needs no rights."""

import os
import shutil
import subprocess
import sys

from ctcr.bench.shared.folder import BUS, MASTER
from ctcr.errors import InputError, Problem

_INSIDE = "CTCR_OWN_NETWORK"


_PAIR = ["ip", "link", "add", MASTER, "type", "veth", "peer", "name", BUS]


def make_cable() -> None:
    """Makes the pair, or finds it there. Raises InputError where this is not permitted."""
    if not shutil.which("ip"):
        raise InputError(Problem("the command `ip` is missing: install iproute2"))
    if subprocess.run(["ip", "link", "show", MASTER], capture_output=True).returncode == 0:
        return
    settings = (["addrgenmode", "none"], ["up"])  # the first: no IPv6 traffic
    for command in (_PAIR, *(["ip", "link", "set", name, *to] for to in settings for name in (MASTER, BUS))):
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode and "File exists" not in done.stderr:
            reason = done.stderr.strip().splitlines()[-1] if done.stderr.strip() else "refused"
            raise InputError(Problem(f"cannot make virtual network interfaces: {reason}", MASTER))


def enter_own_network(arguments: list[str]) -> None:
    """Starts this program again in a network namespace of its own, where that is permitted and not done yet."""
    if not os.environ.get(_INSIDE) and is_permitted():
        os.environ[_INSIDE] = "1"
        os.execvp("unshare", [*_unshare(), sys.executable, "-m", "ctcr", *arguments])


def is_permitted() -> bool:
    """Whether the user may make a network namespace with the pair in it."""
    return bool(shutil.which("unshare")) and subprocess.run([*_unshare(), *_PAIR], capture_output=True).returncode == 0


def _unshare() -> list[str]:
    """Root needs no user namespace, and without one keeps the right to real-time priority."""
    return ["unshare", "-n"] if os.geteuid() == 0 else ["unshare", "-Urn"]
