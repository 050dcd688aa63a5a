"""The compiled library. Modules of this package wrap its functions with types; a checker takes all of it as it is."""

from typing import Any

def __getattr__(name: str) -> Any: ...
