"""What stands in for data sets and edits of an experiment that lack data or weights on this machine."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

from texgs.config.schema import StandIns
from texgs.edit.keys import EditKeys
from texgs.edit.method import method_of
from texgs.models.weights import unusable
from texgs.workflow.edits import ancestry, chain
from texgs.workflow.missing import needed

Lacks = Callable[[str], Sequence[str]]  # what something lacks on this machine, by its name


@dataclass(frozen=True)
class Taken:
    """What is taken for a data set or an edit: itself, or what stands in for it."""

    what: str  # it is taken for, such as "data set mantle"
    name: str
    lacks: Sequence[str] = ()  # sentences on what it stands in for; none where it is taken always
    caption: str = ""  # a sentence for pictures; empty for itself


def data_set(keys: StandIns, name: str, lacks: Lacks) -> Taken:
    """Return what is taken for a data set, by sentences on what one lacks."""
    taken, missing = first(keys, keys.datasets, name, lacks)
    end = ", whose data are not on this machine" if missing else ""
    caption = f"`{taken}` stands in for `{name}`{end}." if taken != name else ""
    return Taken(f"data set {name}", taken, missing, caption)


def edit(keys: StandIns, name: str, words: Iterable[str]) -> Taken:
    """Return what is taken for an edit, by the weights that it and its bases need with some words."""

    def lacks(each: str) -> list[str]:
        names = dict.fromkeys(weights for one in ancestry(each, *words) for weights in needed(one))
        return list(filter(unusable, names))

    taken, absent = first(keys, keys.edits, name, lacks)
    if taken == name:
        return Taken(f"edit {name}", name)
    why = [f"this machine cannot use the weights of {' and '.join(absent)}"] if absent else []
    by = worked_with(ancestry(taken, *words)[-1], ancestry(name, *words)[-1])
    caption = ", as ".join([f"`{taken}`{by} stands in for `{name}`", *why])
    return Taken(f"edit {name}", taken, why, f"{caption}.")


def first(keys: StandIns, table: Mapping[str, str], name: str, lacks: Lacks) -> tuple[str, Sequence[str]]:
    """Return what is taken for a name, and what this lacks; the name itself, where all lack something."""
    others = chain(table, name)[1:]
    if keys.taken == "always" or not others:
        return [name, *others][-1], ()
    missing = lacks(name)
    taken = next((each for each in others if not lacks(each)), name) if missing else name
    return taken, missing if taken != name else ()


def worked_with(taken: EditKeys, real: EditKeys) -> str:
    """Return in brackets what an edit has in place of the weights that another one needs."""
    keys = method_of(taken).of(taken)
    words = [word.rpartition(".")[2].partition("=") for word in needed(real).values()]
    values = [value for key, _, value in words if str(getattr(keys, key, None)) == value]
    return f" ({', '.join(values)})" if values else ""
