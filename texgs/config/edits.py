"""The edits of an experiment, as more words for `compose`."""

from texgs.config.compose import compose, is_scene_file
from texgs.core.errors import ConfigError

OF_ONE = ("edit.name=", "edit.kind=", "edit.base=", "edit.parts=")  # not of what an edit starts from


def edits(words: tuple[str, ...]) -> list[tuple[str, ...]]:
    """The words of each edit of the experiment, those that it starts from before it; none without edits.

    Raises:
        ConfigError: if an edit is named twice, has no file, or starts from itself in the end.
    """
    config = compose(words)
    repeated = [name for name in config.edits if config.edits.count(name) > 1]
    if repeated:
        raise ConfigError(f"edits: expected different names, got {repeated[0]} twice")
    if not config.edits and config.edit.kind == "none":
        return []
    given = [(*words, f"edit={name}") for name in config.edits] or [words]
    found: dict[str, tuple[str, ...]] = {}
    for each in given:
        for name, ancestor in lineage(each):
            found.setdefault(name, ancestor)
    return list(found.values())


def lineage(words: tuple[str, ...]) -> list[tuple[str, tuple[str, ...]]]:
    """Name and words of an edit and of all that it starts from, the first one first.

    Changed values hold for all of them, but for the name, the kind, the base and the parts.

    Raises:
        ConfigError: if it starts from itself.
    """
    found: list[tuple[str, tuple[str, ...]]] = []
    following: tuple[str, ...] | None = words
    while following is not None:
        edit = compose(following).edit
        if edit.name in [name for name, _ in found]:
            raise ConfigError(f"edit.base: {edit.name} starts from itself; choose another base")
        found.append((edit.name, following))
        rest = [word for word in words if not word.startswith(OF_ONE)]
        following = None if edit.base is None or is_scene_file(edit.base) else (*rest, f"edit={edit.base}")
    return found[::-1]
