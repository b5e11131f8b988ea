"""What stands in for data sets and edits of an experiment that lack data or weights on this machine."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

from texgs.config.case import Case
from texgs.config.project import members
from texgs.config.schema import Config, StandIns
from texgs.core.errors import ConfigError
from texgs.core.names import close
from texgs.edit.keys import EditKeys
from texgs.edit.method import method_of
from texgs.models.weights import missing_advice
from texgs.workflow.edits import chain_of
from texgs.workflow.missing import weights_needed

Lacking = Callable[[Config], Sequence[str]]  # sentences on what a configuration lacks on this machine


@dataclass(frozen=True)
class Choice:
    """What is taken for a data set or an edit: itself, or what stands in for it."""

    what: str  # it is taken for, such as "data set mantle"
    taken: str
    lacks: Sequence[str] = ()  # sentences on what the other one lacks; none where it is always replaced
    caption: str = ""  # a sentence for pictures; empty for itself


def chosen_data_set(keys: StandIns, name: str, lacks: Callable[[str], Sequence[str]]) -> Choice:
    """Return what is taken for a data set; `lacks` gives sentences on what a data set lacks."""
    taken, missing = chosen(keys, "datasets", name, lacks)
    end = ", whose data are not on this machine" if missing else ""
    caption = f"`{taken}` stands in for `{name}`{end}." if taken != name else ""
    return Choice(f"data set {name}", taken, missing, caption)


def chosen_edit(keys: StandIns, name: str, case: Case) -> Choice:
    """Return what is taken for an edit, by the weights that it and what it starts from need."""

    def lacks(other: str) -> list[str]:
        edits = [each.config.edit for each in chain_of(case.edited(other))]
        return list(
            filter(
                missing_advice, dict.fromkeys(weights for edit in edits for weights in weights_needed(edit))
            )
        )

    taken, absent = chosen(keys, "edits", name, lacks)
    if taken == name:
        return Choice(f"edit {name}", name)
    why = [f"this machine cannot use the weights of {' and '.join(absent)}"] if absent else []
    recipe = recipe_without(case.edited(taken).config.edit, case.edited(name).config.edit)
    caption = ", as ".join([f"`{taken}`{recipe} stands in for `{name}`", *why])
    return Choice(f"edit {name}", taken, why, f"{caption}.")


def chosen(
    keys: StandIns, group: Literal["datasets", "edits"], name: str, lacks: Callable[[str], Sequence[str]]
) -> tuple[str, Sequence[str]]:
    """Return the first of a name and its stand-ins that lacks nothing, and what the name itself lacks.

    The name stays where all of them lack something; the last one is taken where stand-ins are always taken.
    """
    others = keys.of(group, name)
    if keys.taken == "always" or not others:
        return [name, *others][-1], ()
    missing = lacks(name)
    taken = next((each for each in others if not lacks(each)), name) if missing else name
    return taken, missing if taken != name else ()


def recipe_without(taken: EditKeys, other: EditKeys) -> str:
    """Return in brackets what an edit does in place of the weights that another one needs."""
    keys = method_of(taken).of(taken)
    words = [word.rpartition(".")[2].partition("=") for word in weights_needed(other).values()]
    values = [value for key, _, value in words if str(getattr(keys, key, None)) == value]
    return f" ({', '.join(values)})" if values else ""


def check_stand_ins(keys: StandIns) -> None:
    """Require names of files in conf/."""
    for group, table in (("dataset", keys.datasets), ("edit", keys.edits)):
        known = members(group) if table else []
        if unknown := [name for name in (*table, *table.values()) if name not in known]:
            hint = close(unknown[0], known)
            raise ConfigError(f"stand_ins.{group}s: expected files of conf/{group}, got {unknown[0]}{hint}")
