"""Shared parts of the command lines: messages of mistakes, options from keys, places of outputs."""

import argparse
from collections.abc import Sequence
from dataclasses import MISSING, Field, is_dataclass
from itertools import takewhile
from pathlib import Path
from typing import Any, NoReturn, TypeVar, cast, get_args, get_origin

from texgs.core.errors import ArgumentError
from texgs.core.keys import REQUIRED, ValueMismatch, choices_of, fields_of, typed, without_none
from texgs.core.names import METRICS, close

T = TypeVar("T")


class Parser(argparse.ArgumentParser):
    """Reports a mistake in one sentence, without the usage."""

    def error(self, message: str, where: str = "") -> NoReturn:
        """End with code 2. A misspelt option gets a hint at the one that is like it."""
        unknown = message.partition("unrecognized arguments: ")[2].partition("=")[0].split()
        is_option = bool(unknown) and unknown[0].startswith("-")
        hint = close(unknown[0], self._option_string_actions) if is_option else ""
        self.exit(2, f"{self.prog}: {where}{message}{hint or f'; see {self.prog} --help'}\n")

    def require_options(self, words: Sequence[str]) -> None:
        """Refuse the first unknown option: argparse would rather tell that another one is required."""
        for word in takewhile("--".__ne__, words):
            name = word.partition("=")[0]
            if name.startswith("--") and not any(x.startswith(name) for x in self._option_string_actions):
                self.error(f"unrecognized arguments: {word}")


def option(parser: argparse.ArgumentParser, name: str, default: Any, words: str, **more: Any) -> None:
    """Add an option with the type of its default, which stands behind its help."""
    words = f"{words} (%(default)s)".lstrip()
    parser.add_argument(name, **{"type": type(default), "default": default, "help": words, **more})


def add_keys(parser: argparse._ActionsContainer, schema: Any, without: Sequence[str] = ()) -> None:
    """Add an option for each `key` of a dataclass, which `keys_of` gives back.

    Args:
        parser: of the verb, or a group of it.
        schema: the dataclass; its fields that are no keys, or are dataclasses, become no options.
        without: names of keys that become none either.
    """
    for name, (hint, each) in fields_of(schema).items():
        kind = without_none(hint)
        if "help" not in each.metadata or name in without or is_dataclass(kind):
            continue
        default = each.default if each.default_factory is MISSING else each.default_factory()
        more: dict[str, Any] = {"default": default, "required": default == REQUIRED}
        if kind is bool:
            more["action"] = argparse.BooleanOptionalAction if default else "store_true"
        else:
            choices = ",".join(choices_of(hint, each))
            more["metavar"] = f"{{{choices}}}" if choices else option_of(each)[2:].upper()
        if get_origin(kind) in (list, tuple):
            parts = get_args(kind)
            is_any = get_origin(kind) is list or parts[-1] is ...
            more |= (
                {"nargs": "*"} if is_any else {"nargs": len(parts), "metavar": tuple("XYZW"[: len(parts)])}
            )
        parser.add_argument(option_of(each), dest=name, help=help_of(each, default), **more)


def option_of(each: Field[Any]) -> str:
    """Return the option of a key."""
    return f"--{each.metadata['option'] or each.name.replace('_', '-')}"


def help_of(each: Field[Any], default: Any) -> str:
    """Return the help of a key: its words, unit and default."""
    words = ", ".join(filter(None, (each.metadata["help"], each.metadata["unit"])))
    is_value = isinstance(default, int | float | str) and not isinstance(default, bool)
    return words.replace("%", "%%") + (" (%(default)s)" if is_value and default not in ("", REQUIRED) else "")


def keys_of(arguments: argparse.Namespace, schema: type[T], **more: Any) -> T:
    """Return the checked dataclass of the options of `add_keys`, and of more values by name.

    Raises:
        ArgumentError: naming the option, what was expected and what there was.
    """
    known = fields_of(cast(Any, schema))
    given = {name: getattr(arguments, name) for name in known if hasattr(arguments, name)}
    try:
        return typed(schema, given | more)
    except ValueMismatch as error:
        field = known[error.key.partition(".")[0]][1]
        raise ArgumentError(f"{option_of(field)}: {error.problem}") from error


def require_own_place(output: Path, name: str = "--output") -> None:
    """Require an output outside of the folders of jobs, which are replaced as a whole."""
    for folder in (output, output.parent):
        if (folder / METRICS).exists():
            raise ArgumentError(
                f"{name}: {folder} is a result of the workflow, which makes it anew; choose another"
            )


def require_only_files(files: Sequence[str]) -> None:
    """Require that no option that takes several files has taken a KEY=VALUE behind them."""
    for word in files:
        if "=" in word and not Path(word).is_absolute() and not any(Path().glob(word)):
            raise ArgumentError(
                f"{word}: the option before takes it for a file of its own; put {word} in front of it"
            )


def add_device(parser: argparse.ArgumentParser) -> None:
    """Add where to compute."""
    option(parser, "--device", "cpu", "", choices=("cpu", "cuda"))
