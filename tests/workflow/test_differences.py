"""Where recipes are not as in the paper: its values are ones that their keys can have, and make no rows."""

from dataclasses import asdict

import pytest
import yaml

from tests.report.written import rows
from texgs.config.compose import compose
from texgs.config.describe import keys, value_at
from texgs.edit.method import methods
from texgs.report.differences import NO_KEY, differences, published, text


def cells(table):
    """Cells of each row."""
    return [tuple(row.values()) for row in rows(table)]


def told(*arguments, **options):
    """Rows of keys: what, the paper, here, in."""
    return [row[:4] for row in cells(differences(*arguments, **options)) if row[3] != NO_KEY]


def override(claim):
    return f"{claim.key}={text(claim.paper)}"


@pytest.mark.parametrize("claim", published().keys, ids=lambda claim: claim.key)
def test_keys_are_there_and_can_have_the_papers_values(claim):
    group, method, *rest = claim.key.split(".")
    if group == "edit" and rest[0] == "recipe":
        numbers = methods()[method].settings(recipe="paper").numbers()
        assert rest[1] in numbers
    else:
        assert claim.key in {key.name for key in keys()}
        assert text(value_at(compose((override(claim),)), claim.key)) == text(claim.paper)
    assert claim.where
    assert claim.of is None or claim.of in {other.key for other in published().keys}


def test_values_of_the_paper_make_no_rows_and_others_do(tmp_path, monkeypatch):
    config = compose(("fit=quick", *(override(c) for c in published().keys if c.key.startswith("fit."))))
    folder = tmp_path / "conf" / "fit"
    folder.mkdir(parents=True)
    mine = {**asdict(config.fit), "name": "mine"}
    other = {**mine, "name": "other", "texture": {**mine["texture"], "rate": 0.5}}
    for recipe in (mine, other):
        (folder / f"{recipe['name']}.yaml").write_text(yaml.safe_dump(recipe))
    monkeypatch.chdir(tmp_path)
    assert told(["mine"]) == []
    assert told(["mine", "other"]) == [("fit.texture.rate", "0.025", "0.5", "other")]


@pytest.mark.parametrize(
    ("recipes", "edits", "expected"),
    [
        # Normals count from the iteration of 2DGS on. c_ind starts from the zeroth harmonic and keeps the
        # rate that it has in 2DGS. Both are as in the release.
        (
            ["paper"],
            [],
            {
                ("fit.surfels.losses.normal_from", "0", "7000", "paper"),
                ("fit.shading.rates.colors", "0.01", "0.0007", "paper"),
            },
        ),
        ([], ["style_paper", "text_paper", "lobe_paper"], set()),
        (
            [],
            ["text_paper_untextured"],
            {("edit.text.textured", "true", "false", "text_paper_untextured")},
        ),
        (["gaussians", "quick-variant"], ["none", "arf", "of-the-user"], set()),  # nothing to compare
    ],
)
def test_rows_are_what_differs(recipes, edits, expected):
    assert set(told(recipes, edits)) == expected


@pytest.mark.parametrize(
    ("recipes", "edits", "row"),
    [
        (["quick", "default"], [], ("fit.materials", "surfel", "shared", "quick, default")),  # they share it
        (["quick", "default"], [], ("fit.shading.iterations", "20000", "1000", "quick")),
        ([], ["style"], ("edit.image.recipe.lambda_s", "0.9", "1", "style")),
        ([], ["text", "text_paper"], ("edit.text.recipe.target", "images", "colors", "text")),
        ([], ["text_quick"], ("edit.text.guidance", "instruct_pix2pix", "filters", "text_quick")),
    ],
)
def test_a_row_tells_the_numbers_that_recipes_and_edits_run_with(recipes, edits, row):
    entries = told(recipes, edits)
    assert row in entries
    of_what_is_not_run = {"fit.surfels.rates.sh", "fit.texture.rate"}
    assert not of_what_is_not_run & {entry[0] for entry in entries}


def test_other_numbers_of_views_make_rows_with_their_data_sets():
    views = {"training views": {162: ["wood"], 92: ["bonsai", "engine"]}, "test views": {181: ["wood"]}}
    assert told([], views=views) == [("training views", "162", "92", "bonsai, engine")]


def test_what_no_key_expresses_is_always_told():
    entries = cells(differences([]))
    assert len(entries) == len(published().others) > 10
    assert all(all(row) for row in entries)


def test_values_are_written_as_in_files():
    assert [text(value) for value in (None, True, 1.6e-4, "")] == ["null", "true", "0.00016", '""']
    assert text((2.0, 0.5)) == "[2, 0.5]"


def test_cells_do_not_break_tables():
    assert "|" not in "".join(cell for row in cells(differences(["quick"], ["style"])) for cell in row)
