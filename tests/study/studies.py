"""Results with edited scenes, as the workflow leaves them, and studies of them."""

import json

from texgs.report.results import EditResult, FitResult, SceneResult, plain
from texgs.study.questions import Option, Question, Study

STYLE = {"TF01": "waves"}
WORDS = {"TF01": "make it gold"}


def job(folder, stage, result, dataset="engine", recipe="quick", tf=None, pictures=(), variant=""):
    """metrics.json of a job."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "metrics.json"
    record = {"stage": stage, "dataset": dataset, "recipe": recipe, "tf": tf, "peak_memory_mib": 1.0}
    record["variant"] = variant
    told = {"result": type(result).__name__, "numbers": plain(result)}
    path.write_text(json.dumps({**record, **told, "pictures": dict.fromkeys(pictures, "a picture")}))
    return path


def fit(results, recipe="quick", dataset="engine", psnr=30.0):
    """A fit of one basic TF, and its scene."""
    place = results / dataset
    result = FitResult(1.0, 9, psnr=psnr)
    job(place / "TF01" / recipe / "texture", "texture", result, dataset, recipe, tf="TF01")
    return job(place / "scene" / recipe / "compose", "compose", SceneResult(1, 9), dataset, recipe)


def edit(results, name, recipe="quick", dataset="engine", followed=STYLE, method="image", variant=""):
    """A scene with a new look, of a variant of the edit."""
    follows = "style" if followed == STYLE else "instruction"
    result = EditResult(name, method, "somehow", 1.0, follows=follows, followed=followed)
    pictures = ["style.png", "edit.png"] if follows == "style" else ["edit.png"]
    place = results / dataset / "scene" / recipe / "edits" / "-".join(filter(None, (name, variant)))
    return job(place, f"edit_{method}", result, dataset, recipe, pictures=pictures, variant=variant)


def study(*orders, follows="style"):
    """A study with a question for each order of methods, which are single letters: "yxz"."""
    questions = [
        Question(
            f"data{place}",
            follows,
            STYLE if follows == "style" else WORDS,
            "scene.yaml",
            [],
            [Option("quick", f"edit_{name}", name, f"{name}/scene.yaml") for name in order],
        )
        for place, order in enumerate(orders, start=1)
    ]
    return Study("0123456789ab", 0, questions)
