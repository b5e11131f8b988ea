"""The first words of a report: what a data set is, how good its scene is, and how long it took."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from texgs.core.progress import time_text
from texgs.metrics.quality import WHOLE_SHARE
from texgs.report.fit_tables import end_of, runs_of
from texgs.report.metrics_files import Record, of
from texgs.report.published import in_order, mean
from texgs.report.results import EditResult, FitResult, SceneResult, VolumeResult
from texgs.report.sections import Figure


@dataclass(frozen=True)
class Overview:
    """What stands first of a data set."""

    title: str
    figures: list[Figure]  # of its scene as fitted, and of its volume
    sentences: list[str]


def overviews_of(records: Sequence[Record[Any]], pictures: Sequence[Figure]) -> list[Overview]:
    """Return the overviews of data sets, those with a scene first, with what belongs to them of pictures."""
    by_title: dict[str, list[Record[Any]]] = {}
    for record in in_order(records):
        by_title.setdefault(record.title, []).append(record)
    overviews = []
    for title, own in sorted(by_title.items(), key=lambda item: first_scene(item[1]) is None):
        scene = first_scene(own)
        labels = ("", scene.label if scene else "")
        shown = [each for each in pictures if each.dataset == title and each.label in labels]
        overviews.append(Overview(title, shown, sentences(own)))
    return overviews


def first_scene(records: Sequence[Record[Any]]) -> Record[SceneResult] | None:
    """Return a data set's scene as fitted, one of surfels if there are several recipes; None without one."""
    scenes = [record for record in of(SceneResult, records) if not record.is_swept]
    return min(scenes, key=lambda record: record.field != "surfels", default=None)


def sentences(records: Sequence[Record[Any]]) -> list[str]:
    """Say in up to three sentences what the jobs of one data set are of, how good, and how long they took."""
    scene = first_scene(records)
    fitted = [] if scene is None else [record for record in records if record.label == scene.label]
    return list(filter(None, (what(records, scene), quality(fitted), time(records))))


def what(records: Sequence[Record[Any]], scene: Record[SceneResult] | None) -> str:
    """Describe the data, the scene and its edits."""
    functions = listed({record.tf for record in records if record.tf})
    volumes = [" × ".join(map(str, record.result.dims)) for record in of(VolumeResult, records)]
    words = f"A volume of {volumes[0]} samples" if volumes else "Views"
    words += f", shown by {functions}" if functions else ""
    if scene is not None:
        words += f", as a scene of {scene.result.primitives:,} {scene.field}"
    edits = listed({record.result.edit for record in of(EditResult, records)})
    return f"{words}{f', with the edits {edits}' if edits else ''}."


def quality(records: Sequence[Record[Any]]) -> str:
    """Describe the test views of a recipe's fits: errors on the object, and whether parts are missing."""
    ends = [end for run in runs_of(records) if (end := end_of(run)) and end.result.object_psnr is not None]
    if (level := mean([end.result.object_psnr for end in ends])) is None:
        return ""
    error, worst = 100 * 10 ** (-level / 20), min(ends, key=lambda end: end.result.object_psnr or 0)
    least = f"; the worst is {worst.tf} with {worst.result.object_psnr:.1f} dB" if len(ends) > 1 else ""
    words = (
        "In test views, which no fit has seen, colours on the object are off by about "
        f"{error:.1f} % of full brightness ({level:.1f} dB{least})."
    )
    shares = [end.result.shown for end in ends if end.result.shown is not None]
    if not shares:
        return words
    verdict = "Nothing is missing" if min(shares) >= WHOLE_SHARE else "Parts are missing"
    return f"{words} {verdict}: the scene shows {100 * min(shares):.1f} % of what is there."


def time(records: Sequence[Record[Any]]) -> str:
    """Describe the wall-clock time of all jobs, that of fits, and the devices."""
    spent = sum(record.facts.get("seconds") or 0 for record in records)
    fits = sum(record.result.fit_seconds for record in of(FitResult, records))
    devices = listed({str(record.facts["device"]) for record in records if record.facts.get("device")})
    jobs = f"Its {len(records)} jobs" if len(records) > 1 else "Its job"
    of_fits = f", {time_text(fits)} of it for fits" if fits else ""
    return f"{jobs} took {time_text(spent)}, added up{of_fits}, on {devices}."


def listed(names: set[str]) -> str:
    """Return names in order, such as "A, B and C"."""
    *first, last = sorted(names) or [""]
    return f"{', '.join(first)} and {last}" if first else last
