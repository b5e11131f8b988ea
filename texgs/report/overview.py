"""The first words of a report: what a data set is, how good its scene is, and how long it took."""

from collections.abc import Sequence
from dataclasses import dataclass
from operator import itemgetter
from statistics import fmean
from typing import Any

from texgs.core.progress import time_text
from texgs.report.fit_tables import end_of, runs_of
from texgs.report.metrics_files import Record, of
from texgs.report.published import in_order
from texgs.report.results import EditResult, FitResult, SceneResult, VolumeResult
from texgs.report.sections import Figure


@dataclass(frozen=True)
class Overview:
    """What stands first of a data set."""

    title: str
    figures: list[Figure]  # of its scene as fitted, and of its volume
    sentences: list[str]


def overviews_of(records: Sequence[Record[Any]], pictures: Sequence[Figure]) -> list[Overview]:
    """Return the overviews of data sets, those with a scene first, with what belongs to them of pictures.

    Of several recipes, that is one of surfels.
    """
    by_title: dict[str, list[Record[Any]]] = {}
    for record in in_order(records):
        by_title.setdefault(record.title, []).append(record)
    overviews = []
    for title, own in by_title.items():
        scenes = [record for record in of(SceneResult, own) if not record.is_swept]
        scene = min(scenes, key=lambda record: record.field != "surfels", default=None)
        name = scene.label if scene else ""
        shown = [each for each in pictures if each.dataset == title and each.label in ("", name)]
        words = (what(own, scene), quality([each for each in own if scene and each.label == name]), time(own))
        overviews.append(Overview(title, shown, list(filter(None, words))))
    return sorted(overviews, key=lambda each: not each.figures)


def what(records: Sequence[Record[Any]], scene: Record[SceneResult] | None) -> str:
    """Describe the data, the scene and its edits."""
    functions = ", ".join(sorted({record.tf for record in records if record.tf}))
    volumes = [" × ".join(map(str, record.result.dims)) for record in of(VolumeResult, records)]
    words = f"A volume of {volumes[0]} samples" if volumes else "Views"
    words += f", shown by {functions}" if functions else ""
    if scene is not None:
        words += f", as a scene of {scene.result.primitives:,} {scene.field}"
        words += f" by {scene.label}" if len({each.label for each in of(SceneResult, records)}) > 1 else ""
    edits = ", ".join(sorted({record.result.edit for record in of(EditResult, records)}))
    return f"{words}{f', with the edits {edits}' if edits else ''}."


def quality(records: Sequence[Record[Any]]) -> str:
    """Describe the test views of a recipe's fits: errors on the object, and whether parts are missing."""
    from texgs.metrics.quality import WHOLE_SHARE

    ends = {end.tf: end.result for run in runs_of(records) if (end := end_of(run))}
    levels = {tf: each.object_psnr for tf, each in ends.items() if each.object_psnr is not None}
    if not levels:
        return ""
    level, (worst, least) = fmean(levels.values()), min(levels.items(), key=itemgetter(1))
    spread = f"; {worst} has the least with {least:.1f} dB" if len(levels) > 1 else ""
    words = (
        "In test views, which no fit has seen, colours on the object are off by about "
        f"{100 * 10 ** (-level / 20):.1f} % of full brightness ({level:.1f} dB{spread})."
    )
    shares = [share for tf in levels if (share := ends[tf].shown) is not None]
    if len(shares) == len(levels):  # fits by an older version have none
        shown = min(shares)
        missing = "Nothing is" if shown >= WHOLE_SHARE else "Parts are"
        words += f" {missing} missing: the scene shows {100 * shown:.1f} % of what is there."
    return words


def time(records: Sequence[Record[Any]]) -> str:
    """Describe the wall-clock time of all jobs, that of fits, and the devices."""
    spent = sum(record.facts.get("seconds") or 0 for record in records)
    fits = sum(record.result.fit_seconds for record in of(FitResult, records))
    devices = ", ".join(sorted({str(record.facts.get("device", "")) for record in records} - {""}))
    return f"All jobs took {time_text(spent)}, added up, {time_text(fits)} of it for fits, on {devices}."
