"""What is wrong with a configuration, in one sentence: the key, or the file of conf/ and its line."""

import re
from pathlib import Path

import yaml
from hydra.errors import HydraException, MissingConfigException, OverrideParseException

from texgs.config.describe import keys
from texgs.config.files import files, lines, place, shortened, slip
from texgs.config.project import folders, members
from texgs.core.names import close


def sentence(error: Exception) -> str:
    """What is wrong, from an exception of Hydra, OmegaConf or PyYAML."""
    if isinstance(error, MissingConfigException) and error.missing_cfg_file:
        group, _, name = error.missing_cfg_file.partition("/")
        known = members(group)
        hint = close(name, known) or ("; an address goes to tracking.uri" if group == "tracking" else "")
        return f"{place(file_of(error), '')}{group}: expected one of {', '.join(known)}, got {name}{hint}"
    if isinstance(error, OverrideParseException):
        return (
            f"{shortened(error.override)}: expected key=value, with quotes around a value that has commas, "
            "spaces or ="
        )
    if isinstance(error, TypeError) or "group override" in str(error):
        return "a group: expected the name of a file of conf/, such as dataset=engine, got something else"
    file = file_of(error)
    return (file and slip(file)) or f"{place(file, full_key(error))}{told(error)}"


def told(error: Exception) -> str:
    """The sentence of a library, with the key in front."""
    if isinstance(error, RecursionError):
        return "an override: expected fewer brackets, got more than can be read"
    if isinstance(error, OverflowError):
        return f"{full_key(error)}: expected a finite number, got one that is too large"
    text = next((line for line in lines(error) if not line.startswith("In '")), type(error).__name__)
    name = full_key(error)
    if unknown := re.match(r"Key '([^']+)' (?:not in|is not in)", text):
        return no_such_key(name or unknown[1])
    if missing := re.search(r"missing mandatory value: (\S+)", text):
        return f"{name or missing[1]}: expected a value, got none"
    if missing := re.match(r"Could not override '([^']+)'", str(error)):
        return no_such_key(missing[1])
    return shortened(f"{name}: {text[0].lower()}{text[1:]}" if name else text)


def full_key(error: Exception) -> str:
    """The key that OmegaConf names."""
    named = (line.partition(":")[2].strip() for line in lines(error) if line.startswith("full_key:"))
    return next(named, "")


def no_such_key(name: str) -> str:
    """What to say about a key that the schema does not have."""
    names = [entry.name for entry in keys()]
    groups = dict.fromkeys(each.partition(".")[0] for each in names)
    return f"{name}: no such key{close(name, [*groups, *names])}; texgs views --help lists all"


def file_of(error: Exception) -> Path | None:
    """The file that an exception is about; None where it is about an override."""
    if isinstance(error, yaml.YAMLError):
        mark = getattr(error, "problem_mark", None)
        return Path(mark.name if mark else getattr(error, "name", ""))
    if named := re.search(r"\b[Ii]n '([^']+)'", str(error)):
        candidates = (folder / f"{named[1]}.yaml" for folder in folders() if named[1] != "config")
        return next((path for path in candidates if path.is_file()), None)
    is_told = str(error) and isinstance(error, HydraException)
    return None if is_told else next((path for path in files() if slip(path)), None)
