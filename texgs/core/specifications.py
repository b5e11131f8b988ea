"""Specifications in modules of their own: what a package offers is what its modules define."""

import pkgutil
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from inspect import signature
from traceback import extract_tb
from types import ModuleType
from typing import Any

from texgs.core.errors import ConfigError


@cache
def specifications(package: str, attribute: str) -> dict[str, Any]:
    """Return what the modules of a package define under one name, by the names of the specifications.

    It is one specification or a tuple of some. The modules are imported, so they must stay light: what they
    run imports the rest when it is called. A module without the name, such as METHOD, is a helper of others.

    Raises:
        ConfigError: naming the module that cannot be imported, or whose specification has none or another's
            name.
    """
    defined, modules = dict[str, Any](), dict[str, str]()
    for entry in pkgutil.iter_modules(import_module(package).__path__):
        module = f"{package}.{entry.name}"
        found = getattr(import_specification(module), attribute, ())
        for specification in found if isinstance(found, tuple) else (found,):
            name = getattr(specification, "name", None)
            if not isinstance(name, str):
                got = type(specification).__name__
                raise ConfigError(f"{module}: {attribute}: expected a specification with a name, got {got}")
            if name in defined:
                raise ConfigError(
                    f"{modules[name]} and {module}: expected {attribute} of different names, got {name} "
                    "twice; rename yours"
                )
            defined[name], modules[name] = specification, module
    return dict(sorted(defined.items()))


def import_name(name: str) -> Any:
    """Return what a module defines, by a name such as "texgs.fields.voxels:read_voxels"."""
    module, _, attribute = name.partition(":")
    return getattr(import_specification(module), attribute)


def import_specification(name: str) -> ModuleType:
    """Import a module; what is wrong with it becomes one sentence."""
    try:
        return import_module(name)
    except ConfigError:  # a sentence already
        raise
    except (ImportError, NameError, SyntaxError, TypeError, ValueError) as error:
        spec = find_spec(name)
        lines = [
            each.lineno for each in extract_tb(error.__traceback__) if spec and each.filename == spec.origin
        ]
        where = f"{name}, line {lines[-1]}" if lines else name
        raise ConfigError(f"{where}: {type(error).__name__} where it is imported: {error}") from error


def require_call(owner: str, function: Any, parameters: str) -> None:
    """Require a function that takes these parameters in turn, such as "settings, inputs, output"."""
    if not callable(function):
        raise ConfigError(f"{owner}: expected a function, got {type(function).__name__}")
    known = signature(function)
    try:
        known.bind(*parameters.split(", "))
    except TypeError as error:
        name, own = function.__name__, ", ".join(known.parameters)
        raise ConfigError(f"{owner}: expected {name}({parameters}), got {name}({own})") from error
