"""Results with edited scenes, as the workflow leaves them, and studies of them."""

from tests.report.written import metrics
from texgs.report.results import EditResult, FitResult, SceneResult
from texgs.study.questions import Option, Question, Study

STYLE = {"TF01": "waves"}
WORDS = {"TF01": "make it gold"}


def job(folder, stage, result, pictures=(), **facts):
    """metrics.json of a job."""
    folder.mkdir(parents=True, exist_ok=True)
    facts["pictures"] = dict.fromkeys(pictures, "a picture")
    return metrics(folder, stage, result, name="metrics.json", **facts)


def fit(results, recipe="quick", dataset="engine", psnr=30.0):
    """A fit of one basic TF, and its scene."""
    place = results / dataset
    result = FitResult(1.0, 9, psnr=psnr)
    facts = {"dataset": dataset, "recipe": recipe}
    job(place / "TF01" / recipe / "texture", "texture", result, tf="TF01", **facts)
    return job(place / "scene" / recipe / "compose", "compose", SceneResult(1, 9), **facts)


def edit(results, name, recipe="quick", dataset="engine", followed=STYLE, method="image", variant=""):
    """A scene with a new look, of a variant of the edit."""
    follows = "style" if followed == STYLE else "instruction"
    result = EditResult(name, method, "somehow", 1.0, follows=follows, followed=followed)
    pictures = ["style.png", "edit.png"] if follows == "style" else ["edit.png"]
    place = results / dataset / "scene" / recipe / "edits" / "-".join(filter(None, (name, variant)))
    facts = {"dataset": dataset, "recipe": recipe, "variant": variant}
    return job(place, f"edit_{method}", result, pictures, **facts)


def study(*orders, follows="style"):
    """A study with a question for each order of methods, which are single letters: "yxz"."""
    followed, questions = STYLE if follows == "style" else WORDS, []
    for place, order in enumerate(orders, start=1):
        options = [Option("quick", f"edit_{name}", name, f"{name}/scene.yaml") for name in order]
        questions.append(Question(f"data{place}", follows, followed, "scene.yaml", [], options))
    return Study("0123456789ab", 0, questions)
