"""Metric `views`: the numbers of the measured views of the test path."""

from texgs.metrics.metric import MeasuredScene, Metric


def run(measured: MeasuredScene) -> dict[str, str]:
    """List the views, counted from 1."""
    places, count = measured.places, len(measured.cameras)
    listed = "all" if len(places) == count else ", ".join(str(place + 1) for place in places)
    return {"views": f"{listed} of {count}"}


METRIC = Metric("views", (), run, notes={"views": "Views of the test path that measure: {}."}, order=0)
