"""A pair of virtual network interfaces, joined by a cable: one for the bus, one for who drives it."""

import os
import shutil
import subprocess
import sys

from ctcr.errors import InputError, Problem

MASTER, BUS = "ctcr0", "ctcr1"
_INSIDE = "CTCR_OWN_NETWORK"


def make_cable(master: str = MASTER, bus: str = BUS) -> None:
    """Makes the pair, or finds it there. Raises InputError where this is not permitted."""
    if not shutil.which("ip"):
        raise InputError(Problem("the command `ip` is missing: install iproute2"))
    if os.path.exists(f"/sys/class/net/{master}") and _is_own(master):
        return
    commands = [
        ["link", "add", master, "type", "veth", "peer", "name", bus],
        *(["link", "set", name, "addrgenmode", "none"] for name in (master, bus)),  # no chatter of IPv6
        *(["link", "set", name, "up"] for name in (master, bus)),
    ]
    for command in commands:
        done = subprocess.run(["ip", *command], capture_output=True, text=True)
        if done.returncode and "File exists" not in done.stderr:
            reason = done.stderr.strip().splitlines()[-1] if done.stderr.strip() else "refused"
            raise InputError(Problem(f"cannot make virtual network interfaces: {reason}", master))


def _is_own(name: str) -> bool:
    """Whether this network has it: /sys may show that of another one."""
    done = subprocess.run(["ip", "link", "show", name], capture_output=True)
    return done.returncode == 0


def in_own_network(arguments: list[str]) -> None:
    """Starts this program again in a network of its own, where it may do what it likes; returns if it is there already.

    Raises InputError where the kernel does not permit it.
    """
    if os.environ.get(_INSIDE):
        return
    if not is_permitted():
        text = "this system does not permit networks of one's own (unshare -Urn): see docs/hardware.md"
        raise InputError(Problem(text))
    os.environ[_INSIDE] = "1"
    os.execvp("unshare", [*_unshare(), sys.executable, "-m", "ctcr", *arguments])


def is_permitted() -> bool:
    """Whether a user may make a network of his own here."""
    if not shutil.which("unshare"):
        return False
    test = ["ip", "link", "add", MASTER, "type", "veth", "peer", "name", BUS]
    return subprocess.run([*_unshare(), *test], capture_output=True).returncode == 0


def _unshare() -> list[str]:
    """An administrator needs no names of his own, and keeps the right to real-time priority without them."""
    return ["unshare", "-n"] if os.geteuid() == 0 else ["unshare", "-Urn"]
