"""Weights belong to the settings of the jobs that use them; the verb lists and downloads them."""

import re

import pytest

from tests.cli.conftest import hide_weights
from tests.refusals import refused
from texgs.cli.doctor import weights as weights_of_this_machine
from texgs.cli.main import main
from texgs.config.compose import compose
from texgs.core.cache import Checksums
from texgs.core.errors import MissingDataError
from texgs.models import weights
from texgs.models.catalogue import CATALOGUE
from texgs.workflow.job import settings_digest
from texgs.workflow.missing import missing_weights, require_same, weights_of
from texgs.workflow.provenance import record
from texgs.workflow.stage_table import STAGES

CLIP = "clip-vit-base-patch32"


@pytest.fixture
def there(monkeypatch, tmp_path):
    """Checksums of weights by name, as if they were on this machine."""
    hide_weights(monkeypatch, tmp_path)
    checksums = {}
    monkeypatch.setattr(weights, "checksum", lambda name, _checksums: checksums.get(name))
    return checksums


def settings(stage, *words):
    """Digest of the settings of an edit's job, as the workflow plans it."""
    config = compose(("dataset=orbital", *words))
    used = weights_of(STAGES[stage], config, Checksums())
    return settings_digest({**STAGES[stage].settings(config), "weights": used}), used


def test_measures_change_when_weights_arrive_or_change(there):
    before, used = settings("edit_metrics", "edit=gold")
    assert used == {"vgg16": None, "lpips_vgg": None, CLIP: None}
    there[CLIP] = "0123456789abcdef"
    arrived, used = settings("edit_metrics", "edit=gold")
    assert used[CLIP] == "0123456789ab"
    there[CLIP] = "fedcba9876543210"
    assert len({before, arrived, settings("edit_metrics", "edit=gold")[0]}) == 3


def test_an_edit_changes_with_the_weights_that_it_uses_and_no_others(there):
    plain, used = settings("edit_image", "edit=glass")
    assert used == {}, "patches need no weights"
    there[CLIP] = there["vgg16"] = "0123456789abcdef"
    assert settings("edit_image", "edit=glass")[0] == plain
    _, used = settings("edit_image", "edit=style_paper")
    assert used == {"vgg16": "0123456789ab", CLIP: "0123456789ab"}
    words = ("edit=style_paper", "edit.image.clip=clip-vit-large-patch14", f"metric.clip={CLIP}")
    assert set(settings("edit_image", *words)[1]) == {"vgg16", "clip-vit-large-patch14"}, "that of the loss"
    assert CLIP in settings("edit_metrics", *words)[1], "that of the scores"
    _, used = settings("edit_segment", "edit=lobe", "edit.segment.masks=mobile_sam")
    assert used == {"mobile_sam": None}
    assert weights_of(STAGES["shading"], compose(("dataset=orbital",)), Checksums()) is None


def test_a_job_works_with_the_weights_it_was_planned_with(there):
    there["vgg16"] = "0123456789abcdef"
    require_same({"vgg16": "0123456789ab", CLIP: None})
    there[CLIP] = "0123456789abcdef"
    planned = {"vgg16": "0123456789ab", CLIP: None}
    refused(lambda: require_same(planned), f"weights of {CLIP}: expected none", MissingDataError)


def test_missing_weights_name_the_command_and_are_not_downloaded(there, monkeypatch):
    monkeypatch.setattr(weights, "_download", lambda *_: pytest.fail("downloaded"))
    (line,) = missing_weights(compose(("dataset=orbital", "edit=style")))
    assert line.startswith("edit style: the weights of vgg16 are not on this machine; `texgs weights vgg16`")
    assert "edit.image.recipe=patches" in line


def test_the_papers_share_of_clip_is_refused_without_its_weights(there):
    """As one that is asked for: what another share gives is not the paper's."""
    for name, *words in (("style_paper",), *(("style", f"edit.image.lambda_s={x}") for x in (0, 0.9))):
        lines = missing_weights(compose(("dataset=orbital", f"edit={name}", *words)))
        (of_clip,) = (line for line in lines if f"`texgs weights {CLIP}`" in line)
        assert of_clip.startswith(f"edit {name}: ")
        assert "edit.image.lambda_s=1 " in of_clip
    (line,) = missing_weights(compose(("dataset=orbital", "edit=style_paper", "edit.image.lambda_s=1")))
    assert "vgg16" in line


def test_another_revision_in_the_cache_of_the_hub_is_named_in_lists_and_in_results(
    there, monkeypatch, tmp_path, capsys
):
    monkeypatch.setenv("HF_HUB_CACHE", str(tmp_path))
    folder = tmp_path / "models--openai--clip-vit-base-patch32" / "snapshots" / ("ab" * 20)
    folder.mkdir(parents=True)
    for name in ("config.json", "model.safetensors", "tokenizer.json"):
        (folder / name).write_text("{}")
    named = f"{CLIP} (revision abababababab, not 3d74acf9a28c)"
    assert main(["weights"]) == 0
    assert re.search(rf"^{re.escape(named)} +605 MB +{folder}$", capsys.readouterr().out, re.MULTILINE)
    assert named in weights_of_this_machine().found
    settings = {"stage": "edit_metrics", "dataset": "orbital", "weights": {CLIP: "0123", "vgg16": None}}
    facts = record(settings, {"settings": "a", "code": "b", "inputs": {}}, {}, 1.0)
    assert facts["weights"] == {named: "0123", "vgg16": None}


def test_the_verb_lists_all_and_refuses_unknown_names(there, capsys):
    assert main(["weights"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == len(CATALOGUE)
    assert all("not here; http" in line for line in lines)
    assert main(["weights", "resnet"]) == 2
    assert "weights: expected one of vgg16," in capsys.readouterr().err
