"""The edits of an experiment, as more words for `compose`, and the parts that they give a scene."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from texgs.config.compose import compose
from texgs.config.composition import Words
from texgs.config.project import is_scene_file, members
from texgs.core.errors import ConfigError, MissingDataError
from texgs.core.names import close
from texgs.edit.method import NO_METHOD, method_of
from texgs.workflow.inputs import scene_before
from texgs.workflow.locate import tf_names

if TYPE_CHECKING:
    from texgs.edit.keys import EditKeys

OF_ONE = ("edit.name=", "edit.method=", "edit.base=", "edit.parts=")  # not of what an edit starts from


def edits(words: Words) -> list[Words]:
    """Return the words of each edit of the experiment, those that it starts from before it."""
    config = compose(words)
    if repeated := [name for name in config.edits if config.edits.count(name) > 1]:
        raise ConfigError(f"edits: expected different names, got {repeated[0]} twice")
    if not config.edits and config.edit.method == NO_METHOD:
        return []
    by_name: dict[str, Words] = {}
    for each in [(*words, f"edit={name}") for name in config.edits] or [words]:
        for name, ancestor in lineage(each):
            by_name.setdefault(name, ancestor)
    return list(by_name.values())


def lineage(words: Words) -> list[tuple[str, Words]]:
    """Return name and words of an edit and of all that it starts from, the first one first.

    Changed values hold for all of them, but for the name, the kind, the base and the parts.
    """
    chain: list[tuple[str, Words]] = []
    following: Words | None = words
    while following is not None:
        edit = compose(following).edit
        if edit.name in [name for name, _ in chain]:
            raise ConfigError(f"edit.base: {edit.name} starts from itself; choose another base")
        chain.insert(0, (edit.name, following))
        rest = [word for word in words if not word.startswith(OF_ONE)]
        following = None if edit.base is None or is_made(following) else (*rest, f"edit={edit.base}")
    require_parts([each for _, each in chain])
    return chain


def is_made(words: Words) -> bool:
    """Return whether an edit starts from a scene that is there, and not from another edit of conf/edit."""
    config = compose(words)
    base, known = config.edit.base, members("edit")
    if is_scene_file(base):
        return True
    if base in known:
        return False
    if scene_before(config).is_file():
        return True
    raise ConfigError(
        f"edit.base: expected the file of a scene or one of {', '.join(known)}, got {base}"
        f"{close(base, known)}"
    )


def require_parts(chain: Sequence[Words]) -> None:
    """Require of edits, each of which starts from the one before it, that the parts they change are there."""
    chained = [compose(words).edit for words in chain]
    if chained[0].base is not None:  # a scene that is there already, and says so at once
        return
    try:
        models = tf_names(compose(chain[0]))
    except MissingDataError:  # which is told elsewhere
        return
    known = list(models)
    for edit in chained:
        for part in edit.parts:
            if part not in known:
                hint = close(part, known)
                raise ConfigError(f"edit.parts: expected some of {', '.join(known)}, got {part}{hint}")
        known += added_parts(edit, models)


def added_parts(edit: EditKeys, models: Sequence[str]) -> Sequence[str]:
    """Return the parts that an edit adds to a scene of some models."""
    return method_of(edit).of(edit).adds(models)


def ancestry(name: str) -> list[EditKeys]:
    """Return an edit of conf/edit and those that it starts from, the first one first."""
    edit = compose((f"edit={name}",)).edit
    is_first = edit.base is None or is_scene_file(edit.base) or edit.base not in members("edit")
    return [edit] if is_first else [*ancestry(edit.base), edit]
