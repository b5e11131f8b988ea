"""A data set of several channels: what its keys may say, what its jobs read, and what these make of it."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from tests.refusals import refused
from tests.volume.zarr_files import axes_of, write_image
from texgs.config.compose import compose
from texgs.config.dataset import Dataset
from texgs.core.errors import ConfigError
from texgs.core.io import read_json
from texgs.volume.basic_tfs import BasicTF
from texgs.volume.settings import VolumeKeys
from texgs.volume.view_set import read_views
from texgs.workflow.checks import check_basic_tfs
from texgs.workflow.execution import ensure
from texgs.workflow.job import settings_digest
from texgs.workflow.stage import result_file
from texgs.workflow.stage_table import STAGES, jobs

SHELL = {"opacity": [[30.0, 0.0], [80.0, 0.5], [99.0, 0.5]], "color": [[30.0, 0.1, 0.2, 0.9]]}
CORE = {"opacity": [[50.0, 0.0], [90.0, 0.6]], "color": [[50.0, 0.2, 0.9, 0.1]]}
SMALL = (
    "views=small",
    "views.width=24",
    "views.height=24",
    "views.turntable=1",
    "tracking=none",
    "fit=quick",
)


@pytest.fixture(scope="module")
def image(tmp_path_factory):
    """Two balls that overlap, one in each channel."""
    z, y, x = np.mgrid[:16, :16, :16] - 7.5
    balls = [100 - 12 * np.sqrt((x - place) ** 2 + y**2 + z**2) for place in (-2, 2)]
    values = np.stack(balls).clip(0).astype(np.uint8)
    path = tmp_path_factory.mktemp("image") / "cells.zarr"
    return write_image(path, [values], axes_of("czyx"), [(1, 1, 1, 1)], labels=["DAPI", "GFP"])


def config_of(image, folder, tfs, words=SMALL, **volume):
    keys = VolumeKeys(generator=None, file=str(image), **volume)
    dataset = Dataset(name="cells", title="cells", volume=keys, basic_tfs=tfs)
    return replace(compose(words), dataset=dataset, results=str(folder))


@pytest.fixture(scope="module")
def both(image, tmp_path_factory):
    tfs = {"shell": BasicTF(**SHELL, channel="DAPI"), "core": BasicTF(**CORE, channel="1")}
    return config_of(image, tmp_path_factory.mktemp("both"), tfs)


def run(stage, config):
    """Run a stage of the volume, and that before it."""
    for name in dict.fromkeys(("volume", stage)):
        ensure(STAGES[name], config, tell=lambda line: None)


def views_of(config, tf):
    run("views", replace(config, tf=tf))
    return read_views(result_file("views", config, tf=tf).parent)


def test_views_of_a_function_are_those_of_a_data_set_of_its_channel(both, image, tmp_path):
    """Bit by bit; only the frame is that of both, so cameras are given."""
    words = (*SMALL, "views.radius=1.5")
    alone = config_of(image, tmp_path, {"core": BasicTF(**CORE)}, words, channel="GFP")
    both = replace(both, views=alone.views)
    seen, expected = views_of(both, "core"), views_of(alone, "core")
    for split in ("train", "test", "relit"):
        for one, other in zip(getattr(seen, split), getattr(expected, split), strict=True):
            assert torch.equal(one.camera.viewmat, other.camera.viewmat)
            assert torch.equal(one.load(), other.load())
            assert one.load().any()
    assert seen.metadata["tf"].get("channel", 0) == both.dataset.prepared.index("1")


def test_the_volume_is_prepared_once_for_all_functions_and_again_for_other_channels(both):
    stages = [(stage.name, each.tf) for stage, each in jobs(both) if stage.name in ("volume", "views")]
    assert stages == [("volume", None), ("views", "shell"), ("views", "core")]
    tfs = both.dataset.basic_tfs

    def digest(**changed):
        dataset = replace(both.dataset, basic_tfs={**tfs, **changed})
        return settings_digest(STAGES["volume"].settings(replace(both, dataset=dataset)))

    assert (
        digest()
        == digest(core=replace(tfs["core"], opacity=[[0.0, 0.0], [9.0, 1.0]]))
        == digest(more=tfs["core"])
    )
    assert digest() != digest(core=replace(tfs["core"], channel="DAPI"))


def test_metrics_and_summary_tell_of_all_channels(both):
    run("transfer", both)
    folder = result_file("volume", both).parent
    summary, metrics = read_json(folder / "volume.json"), read_json(folder / "metrics.json")["numbers"]
    assert list(summary["channels"]) == ["DAPI", "1"]
    assert metrics["maximum"] == max(each["maximum"] for each in summary["channels"].values())
    assert metrics["volume_mib"] * 2**20 == pytest.approx(2 * 16**3, rel=0.1)


@pytest.mark.parametrize(
    ("changed", "volume", "message"),
    [
        ({"core": None}, {}, r"cells: basic TF core: expected a channel, .* \(DAPI\), got none"),
        ({}, {"channel": "GFP"}, r"dataset.volume.channel: expected none, .* \(DAPI, 1\), got GFP"),
        ({}, {"generator": "sphere"}, "cells: basic TFs: expected none that name channels, .* got DAPI"),
    ],
)
def test_keys_that_do_not_fit_each_other_are_refused(both, changed, volume, message):
    tfs = {
        name: replace(tf, channel=changed.get(name, tf.channel))
        for name, tf in both.dataset.basic_tfs.items()
    }
    keys = replace(both.dataset.volume, **volume)
    refused(lambda: check_basic_tfs(replace(both.dataset, volume=keys, basic_tfs=tfs)), message, ConfigError)


def test_only_functions_of_one_channel_must_not_overlap(both):
    check_basic_tfs(both.dataset)
    same = {name: replace(tf, channel="GFP") for name, tf in both.dataset.basic_tfs.items()}
    refused(lambda: check_basic_tfs(replace(both.dataset, basic_tfs=same)), "cells: basic TFs shell and core")


def test_a_channel_that_the_file_lacks_is_told(both):
    wrong = {**both.dataset.basic_tfs, "core": replace(both.dataset.basic_tfs["core"], channel="RFP")}
    config = replace(both, dataset=replace(both.dataset, basic_tfs=wrong), results=f"{both.results}/other")
    refused(lambda: run("volume", config), r"expected one of 0 \(DAPI\), 1 \(GFP\), got RFP")
