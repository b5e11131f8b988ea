"""A toy of a method: everything fades. All that a method needs is in one file."""

from dataclasses import dataclass

from texgs.core.keys import key
from texgs.edit.method import Method, MethodKeys


@dataclass(frozen=True)
class FadeKeys(MethodKeys):
    """How much."""

    opacity: float = key(0.5, "factor on opacities", least=0, most=1)


def run(task):
    """Let all models fade."""
    from texgs.edit.task import EditedScene
    from texgs.scene.session import Session

    session = Session(task.scene)
    for model in task.scene.models:
        session.set(model, "opacity", task.settings.opacity)
    return EditedScene(session.scene, "a toy")


METHOD = Method("fade", "let a scene fade", FadeKeys, run, needs=frozenset({"opacity"}))
