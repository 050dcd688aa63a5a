"""The fault of a device, with its remedy for the person at the bench."""

from importlib import import_module
from types import ModuleType

from ctcr.errors import InputError, Problem


class DeviceFault(InputError):
    """A device cannot do what it should. `code` is the device's own, `remedy` what to do about it."""

    def __init__(self, device: str, what: str, remedy: str, code: int | None = None):
        self.device, self.what, self.remedy, self.code = device, what, remedy, code
        super().__init__(Problem(f"{what}: {remedy}", device))

    def __reduce__(self):  # faults cross from one process to another
        return DeviceFault, (self.device, self.what, self.remedy, self.code)


def needed(package: str, name: str, device: str) -> ModuleType:
    """The module `name` of an optional package: imported here and late, so that all of ctcr loads without it.

    Raises DeviceFault with the install command where the package is missing.
    """
    try:
        return import_module(name)
    except ModuleNotFoundError:
        remedy = 'install it with `pip install "ctcr[bench]"`'
        raise DeviceFault(device, f"the Python package {package} is missing", remedy) from None
