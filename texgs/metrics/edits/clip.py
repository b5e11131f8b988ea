"""Metric `clip`: how well an edit fits its caption, as InstructPix2Pix measures it."""

from typing import Any

from texgs.metrics.metric import Measure, MeasuredScene, Metric


def run(measured: MeasuredScene) -> dict[str, Any]:
    """Score views with CLIP, or say why not."""
    from texgs.core.progress import progress
    from texgs.models.clip import Clip, clip_scores
    from texgs.models.weights import missing_advice

    if measured.weights[measured.clip] is None:
        return {"clip_missing": missing_advice(measured.clip)}
    if not all(measured.captions):
        return {"clip_missing": "the edit has no captions"}
    clip = Clip.load(measured.clip, measured.shown.device)
    scene, composition = measured.scenes[0], measured.compositions[0]
    places = progress(measured.places, title=f"{measured.title}, CLIP", unit="view")
    after = (measured.frame(place).color.clamp(0, 1) for place in places)
    frames = (composition.render(camera, scene.light, scene.edits) for camera in measured.some)
    before = (frame.color.clamp(0, 1) for frame in frames)
    similarity, direction = clip_scores(clip, after, before, *measured.captions)
    return {"clip": clip.name, "similarity": similarity, "direction": direction}


METRIC = Metric(
    "clip",
    (
        Measure("similarity", "CLIP similarity", 3, "up", "clip_similarity"),
        Measure("direction", "CLIP direction", 3, "up", "clip_directional_similarity"),
    ),
    run,
    notes={
        "clip": "CLIP of the scores: {}; that of a loss stands beside its method.",
        "clip_missing": "CLIP not measured: {}.",
    },
    order=10,
)
