"""The compiled energy minimiser: built on demand by a plain compiler call, used through ctypes."""

import ctypes
import hashlib
import os
import subprocess
from functools import cache
from pathlib import Path

import numpy as np

SOURCE = Path(__file__).with_name("kernel.cpp")
HEADERS = "kernel_*.hpp"  # beside it
BUILD = Path(__file__).resolve().parents[2] / "build" / "oracle"
COMPILER = os.environ.get("CXX", "g++")
FLAGS = ("-std=c++20", "-O3", "-march=native", "-shared", "-fPIC")
CONVERGED, MOST_STEPS = 1e-8, 200

_DOUBLES, _INTEGERS = ctypes.POINTER(ctypes.c_double), ctypes.POINTER(ctypes.c_int)


class _Problem(ctypes.Structure):
    _fields_ = [
        *((name, ctypes.c_int) for name in ("elements", "tubes", "table_size", "contacts", "obstacles")),
        ("table_step", ctypes.c_double),
        ("h", _DOUBLES),
        ("tip", _INTEGERS),
        *((name, _DOUBLES) for name in ("stiffness", "torsion", "precurvature", "tangent", "base", "joint", "force")),
        ("contact_node", _INTEGERS),
        *((name, _DOUBLES) for name in ("contact", "plastic", "plastic_anchor", "obstacle")),
    ]


class NoEquilibriumError(RuntimeError):
    """The minimisation did not reach a stable equilibrium."""


@cache
def _library() -> ctypes.CDLL:
    command = [COMPILER, *FLAGS, str(SOURCE)]
    version = subprocess.run([COMPILER, "--version"], capture_output=True, check=True).stdout
    key = hashlib.sha256(b"".join([SOURCE.read_bytes(), repr(command[:-1]).encode(), version])).hexdigest()[:16]
    target = BUILD / f"kernel-{key}.so"
    if not target.exists():
        BUILD.mkdir(parents=True, exist_ok=True)
        unfinished = target.with_suffix(f".{os.getpid()}")
        subprocess.run([*command, "-o", str(unfinished)], check=True)
        unfinished.rename(target)
    library = ctypes.CDLL(str(target))
    library.oracle_energy.restype = ctypes.c_double
    return library


class Problem:
    """One configuration for the kernel; the fields are those of `Problem` in kernel.cpp, absent ones empty."""

    def __init__(self, *, h: np.ndarray, tip: np.ndarray, table_step: float = 1.0, **arrays: np.ndarray) -> None:
        self.h, self.tip = np.ascontiguousarray(h, float), np.ascontiguousarray(tip, np.int32)
        self._arrays = {
            name: np.ascontiguousarray(array, float) for name, array in arrays.items() if name != "contact_node"
        }
        self._contact_node = np.ascontiguousarray(arrays.get("contact_node", ()), np.int32)
        n_tubes = self.tip.size
        self.offset = 2 * self.h.size + np.concatenate([[0], np.cumsum(self.tip + 1)])
        counts = {
            "elements": self.h.size,
            "tubes": n_tubes,
            "table_size": self._arrays["tangent"].shape[1] if "tangent" in arrays else 0,
            "contacts": self._contact_node.size // 2,
            "obstacles": self._arrays["obstacle"].size // 5 if "obstacle" in arrays else 0,
            "table_step": table_step,
        }
        pointers = {name: array.ctypes.data_as(_DOUBLES) for name, array in self._arrays.items()}
        self._struct = _Problem(
            **counts,
            h=self.h.ctypes.data_as(_DOUBLES),
            tip=self.tip.ctypes.data_as(_INTEGERS),
            contact_node=self._contact_node.ctypes.data_as(_INTEGERS),
            **pointers,
        )

    @property
    def size(self) -> int:
        return int(self.offset[-1])

    def theta(self, x: np.ndarray, tube: int) -> np.ndarray:
        """(tip + 1,) view: angle of the tube at its nodes."""
        return x[self.offset[tube] : self.offset[tube + 1]]

    def rotation_vectors(self, x: np.ndarray) -> np.ndarray:
        """(M, 2) view: rotation of each element."""
        return x[: 2 * self.h.size].reshape(-1, 2)

    def minimise(self, x: np.ndarray) -> np.ndarray:
        """Unknowns (size,) of the equilibrium near x."""
        x = np.array(x, float)
        steps = _library().oracle_minimise(
            ctypes.byref(self._struct), x.ctypes.data_as(_DOUBLES), ctypes.c_double(CONVERGED), MOST_STEPS
        )
        if steps < 0:
            raise NoEquilibriumError("the energy minimisation did not converge")
        return x

    def energy(self, x: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
        """Energy [J], gradient (size,), Hessian (size, size)."""
        gradient, hessian = np.empty(self.size), np.empty((self.size, self.size))
        value = self._call("oracle_energy", x, gradient, hessian)
        return value, gradient, hessian

    def frames(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Position (M+1, 3) [m] and torsion-free frame (M+1, 3, 3) of the nodes."""
        position, rotation = np.empty((self.h.size + 1, 3)), np.empty((self.h.size + 1, 3, 3))
        self._call("oracle_frames", x, position, rotation)
        return position, rotation

    def sections(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(N, M, 2) bending moment in the torsion-free frame [N m], and deviation from the precurvature in the tube's
        frame [1/m]; zero where the tube is not."""
        moment, deviation = np.zeros((2, self.tip.size, self.h.size, 2))
        self._call("oracle_sections", x, moment, deviation)
        return moment, deviation

    def _call(self, name: str, x: np.ndarray, *outputs: np.ndarray) -> float:
        x = np.ascontiguousarray(x, float)
        pointers = [array.ctypes.data_as(_DOUBLES) for array in (x, *outputs)]
        return getattr(_library(), name)(ctypes.byref(self._struct), *pointers)
