"""Packages that need not be installed, loaded when they are used."""

from __future__ import annotations

import importlib
from typing import Any


def load(module: str, extra: str) -> Any:
    """A package of an extra. Raises ImportError that tells how to install it."""
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        if error.name != module.partition(".")[0]:
            raise
        text = f'this needs {error.name}, which is not installed: pip install "signorini[{extra}]"'
        raise ImportError(text, name=error.name) from error
