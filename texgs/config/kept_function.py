"""A function of a scene, kept as a basic transfer function in the file of the data set of its volume."""

import os
from dataclasses import replace
from pathlib import Path

from texgs.config.compose import recompose
from texgs.config.dataset_text import require_read, with_basic_tf
from texgs.config.project import ROOT, check_name, own_folder, short_path
from texgs.core.errors import ArgumentError, ConfigError, errors_at
from texgs.core.io import read_json, write_bytes
from texgs.core.names import METRICS, mask_name
from texgs.scene.scene import Scene
from texgs.volume.basic_tfs import basic_tf_of, function_of
from texgs.volume.framing import frame_of, out_of_frame
from texgs.volume.nrrd_file import open_grid
from texgs.volume.summaries import read_summaries
from texgs.volume.transfer import check_disjoint


def keep(scene: Scene, name: str) -> str:
    """Write a function of a scene into the file of its data set; return sentences about the consequences.

    Views stay framed as they are, so that the workflow makes those of the function and refits nothing else.
    """
    volume = scene.volume
    known = {} if volume is None else {**volume.tfs, **scene.functions}
    if volume is None or name not in known:
        raise ArgumentError(f"functions: expected one of a volume ({', '.join(known) or 'none'}), got {name}")
    check_name("function", name)
    file = file_of(volume.file)
    dataset, text = recompose((f"dataset={file.stem}",)).dataset, file.read_bytes().decode()
    summaries = read_summaries(volume.file)
    ends = [(each["minimum"], each["maximum"]) for each in summaries.values()]
    low, high = ends[known[name].channel]
    with errors_at(short_path(file)):
        if name in dataset.basic_tfs:
            raise ArgumentError(f"basic_tfs: {name} is there already; copy the function, or edit the file")
        if len(summaries) > 1 and [*summaries] != dataset.prepared:
            raise ArgumentError(
                f"basic_tfs: expected those of the scene's volume, of {', '.join(summaries)}, got others, of "
                f"{', '.join(dataset.prepared)}; make the scene again by texgs run dataset={dataset.name}"
            )
        tf = known[name].rounded(low, high)
        is_fraction = dataset.tf_values == "fraction"
        is_scaled = [is_fraction and not each.startswith(mask_name("")) for each in summaries]
        if is_scaled[known[name].channel]:
            tf = known[name].with_values(lambda value: (value - low) / (high - low)).rounded(0, 1)
        basic_tfs = {**dataset.basic_tfs, name: basic_tf_of(tf, dataset.prepared)}
        tfs = {key: function_of(points, dataset.prepared) for key, points in basic_tfs.items()}
        tfs = {key: tf.scaled(*ends[tf.channel]) if is_scaled[tf.channel] else tf for key, tf in tfs.items()}
        with errors_at("basic_tfs"):
            check_disjoint(tfs)
        framing, grid = dataset.framing, open_grid(volume.file)
        far = out_of_frame(grid, tfs[name], frame_of(grid, [tfs[key] for key in framing]))
        text = with_basic_tf(text, name, basic_tfs[name], [] if dataset.framed_by else framing)
        require_read(text, replace(dataset, basic_tfs=basic_tfs, framed_by=framing))
    write_bytes(file, text.encode())
    done = f"{short_path(file)}: {name} is a basic transfer function; then: texgs run dataset={dataset.name}"
    return f"{done}. It {far}." if far else done


def file_of(volume: Path) -> Path:
    """Return the file of a prepared volume's data set; it must belong to this project and be writable."""
    with errors_at("volume: expected one that texgs volume has made of a data set"):
        facts = read_json(volume.with_name(METRICS))
        check_name("its name", name := str(facts.get("dataset") if isinstance(facts, dict) else facts))
    file, shipped = (folder / "dataset" / f"{name}.yaml" for folder in (own_folder(), ROOT / "conf"))
    if not file.is_file():
        got = (
            f"that of texgs; copy {shipped}"
            if shipped.is_file()
            else "none; start in the folder of the project"
        )
        raise ConfigError(
            f"{short_path(file)}: expected the data set of the scene in this project, got {got}"
        )
    if not (os.access(file, os.W_OK) and os.access(file.parent, os.W_OK)):
        raise ConfigError(
            f"{short_path(file)}: expected a file that can be written, got a read-only one; allow it"
        )
    return file
