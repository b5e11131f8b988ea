"""A toy of a metric: how bright an edited scene is. All that a metric needs is in one file."""

from texgs.metrics.metric import Measure, Metric


def run(measured):
    """Mean of all pixels of the views."""
    scene, composition = measured.after, measured.shown
    views = [composition.render(camera, scene.light, scene.edits).color for camera in measured.some]
    return {"brightness": float(sum(view.mean() for view in views) / len(views))}


METRIC = Metric("brightness", (Measure("brightness", "mean brightness", 3, "up"),), run)
