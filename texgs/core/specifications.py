"""Specifications in modules of their own: what a package offers is what its modules define."""

import pkgutil
from functools import cache
from importlib import import_module
from typing import Any


@cache
def specifications(package: str, attribute: str) -> dict[str, Any]:
    """Return what the modules of a package define under one name, by the names of the specifications.

    The modules are imported, so they must stay light: what they run imports the rest when it is called. A
    module without the name, such as METHOD, is a helper of others.
    """
    folder = import_module(package).__path__
    modules = (import_module(f"{package}.{entry.name}") for entry in pkgutil.iter_modules(folder))
    defined = [getattr(module, attribute) for module in modules if hasattr(module, attribute)]
    return {specification.name: specification for specification in defined}
