"""The edits of an experiment, as more words for `compose`."""

from texgs.config.check import is_scene_file
from texgs.config.compose import compose
from texgs.config.project import members
from texgs.core.errors import ConfigError, MissingDataError
from texgs.core.names import close
from texgs.edit.method import NO_METHOD, method_of
from texgs.workflow.inputs import scene_before
from texgs.workflow.locate import tf_names

OF_ONE = ("edit.name=", "edit.method=", "edit.base=", "edit.parts=")  # not of what an edit starts from


def edits(words: tuple[str, ...]) -> list[tuple[str, ...]]:
    """The words of each edit of the experiment, those that it starts from before it; none without edits."""
    config = compose(words)
    repeated = [name for name in config.edits if config.edits.count(name) > 1]
    if repeated:
        raise ConfigError(f"edits: expected different names, got {repeated[0]} twice")
    if not config.edits and config.edit.method == NO_METHOD:
        return []
    given = [(*words, f"edit={name}") for name in config.edits] or [words]
    by_name: dict[str, tuple[str, ...]] = {}
    for each in given:
        for name, ancestor in lineage(each):
            by_name.setdefault(name, ancestor)
    return list(by_name.values())


def lineage(words: tuple[str, ...]) -> list[tuple[str, tuple[str, ...]]]:
    """Name and words of an edit and of all that it starts from, the first one first.

    Changed values hold for all of them, but for the name, the kind, the base and the parts.
    """
    chain: list[tuple[str, tuple[str, ...]]] = []
    following: tuple[str, ...] | None = words
    while following is not None:
        edit = compose(following).edit
        if edit.name in [name for name, _ in chain]:
            raise ConfigError(f"edit.base: {edit.name} starts from itself; choose another base")
        chain.append((edit.name, following))
        rest = [word for word in words if not word.startswith(OF_ONE)]
        following = None if edit.base is None or is_made(following) else (*rest, f"edit={edit.base}")
    require_parts(chain[::-1])
    return chain[::-1]


def is_made(words: tuple[str, ...]) -> bool:
    """Whether an edit starts from a scene that is there already, and not from another edit of conf/edit."""
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


def require_parts(chain: list[tuple[str, tuple[str, ...]]]) -> None:
    """Require of edits, each of which starts from the one before it, that the parts they change are there."""
    first = compose(chain[0][1])
    if first.edit.base is not None:  # a scene that is there already, and says so at once
        return
    try:
        known = tf_names(first)
    except MissingDataError:  # which is told elsewhere
        return
    models = list(known)
    for _, words in chain:
        edit = compose(words).edit
        for part in edit.parts:
            if part not in known:
                hint = close(part, known)
                raise ConfigError(f"edit.parts: expected some of {', '.join(known)}, got {part}{hint}")
        method = method_of(edit)
        known += method.adds(method.of(edit), models)
