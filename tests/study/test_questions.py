"""What is compared in which question, and the key."""

from tests.refusals import refused
from tests.report.written import read
from tests.study.studies import WORDS, edit, fit, job, study
from texgs.report.metrics_files import below
from texgs.report.results import EditResult
from texgs.study.questions import questions_of, rank_name, read_key, write_key


def questions(results, edits=(), seed=0):
    return questions_of(read(below(results)), edits, seed)


def names(question):
    return sorted(option.edit for option in question.options)


def test_scenes_that_follow_the_same_are_one_question_pictures_first(tmp_path):
    for dataset in ("wood", "engine"):
        fit(tmp_path, dataset=dataset)
        for name in ("arf", "style"):
            edit(tmp_path, name, dataset=dataset)
        for name in ("dge", "text"):
            edit(tmp_path, name, dataset=dataset, followed=WORDS, method="text")
    edit(tmp_path, "copper", dataset="wood", followed={"TF01": "make it copper"}, method="text")
    asked = questions(tmp_path)
    assert [(each.follows, each.dataset, names(each)) for each in asked] == [
        ("style", "engine", ["arf", "style"]),
        ("style", "wood", ["arf", "style"]),
        ("instruction", "engine", ["dge", "text"]),
        ("instruction", "wood", ["dge", "text"]),
    ], "copper is alone with its instruction"
    assert [len(each.pictures) for each in asked] == [1, 1, 0, 0]
    assert asked[0].pictures[0].endswith("style.png")
    assert asked[0].options[0].scene.endswith(f"{asked[0].options[0].edit}/scene.yaml")


def test_the_order_is_random_and_that_of_the_seed(tmp_path):
    fit(tmp_path)
    for name in "abcde":
        edit(tmp_path, name)
    orders = [[option.edit for option in questions(tmp_path, seed=seed)[0].options] for seed in range(60)]
    assert orders[7] == [option.edit for option in questions(tmp_path, seed=7)[0].options]
    firsts = {name: sum(order[0] == name for order in orders) for name in "abcde"}
    assert min(firsts.values()) >= 3, "12 are expected of each; fewer than 3 in one of 1,000 sets of seeds"


def test_edits_are_chosen_and_the_scene_before_is_of_the_best_fit(tmp_path):
    for recipe, psnr in (("quick", 30.0), ("plenoxels", 33.0), ("other", 40.0)):
        fit(tmp_path, recipe, psnr=psnr)
    edit(tmp_path, "style")
    edit(tmp_path, "arf", recipe="plenoxels", method="arf")
    edit(tmp_path, "untextured")
    (question,) = questions(tmp_path, ["style", "arf"])
    assert names(question) == ["arf", "style"]
    assert question.original.endswith("scene/plenoxels/compose/scene.yaml"), "no clip is of `other`"


def test_variants_of_an_edit_have_the_scene_before_them(tmp_path):
    fit(tmp_path)
    for variant in ("0.5", "0.9"):
        edit(tmp_path, "style", variant=variant)
    (question,) = questions(tmp_path)
    assert sorted(option.recipe for option in question.options) == ["quick-0.5", "quick-0.9"]
    assert question.original.endswith("scene/quick/compose/scene.yaml")


def test_what_cannot_be_asked_is_told(tmp_path):
    job(tmp_path / "core", "edit_segment", EditResult("core", "segment", "grabcut", 1.0))
    refused(lambda: questions(tmp_path), "new look")
    edit(tmp_path, "style")
    edit(tmp_path, "text", followed=WORDS)
    refused(lambda: questions(tmp_path), "engine style, engine text")
    refused(lambda: questions(tmp_path, ["arf"]), "--edits: .* got arf")
    edit(tmp_path, "arf")
    refused(lambda: questions(tmp_path), "no scene of engine by quick")
    fit(tmp_path)
    for number in range(25):
        edit(tmp_path, f"style{number}")
    refused(lambda: questions(tmp_path), "at most 26")


def test_ranks_have_the_papers_names():
    ends = ("second-best", "second-worst")
    for between in ((), ends[:1], ends, (ends[0], "rank 3", "rank 4", ends[1])):
        count = len(between) + 2
        assert [rank_name(rank, count) for rank in range(1, count + 1)] == ["best", *between, "worst"]


def test_a_key_is_read_as_it_was_written(tmp_path):
    path = write_key(tmp_path / "key.json", study("xyz", "zy"))
    assert read_key(path) == study("xyz", "zy")
    changed = [study("xyz", "z"), study("xx"), study("xy", follows="music"), study()]
    files = [write_key(tmp_path / f"{index}.json", each) for index, each in enumerate(changed)]
    path.write_text('{"study": 3}')
    for file in (*files, path, tmp_path / "none.json"):
        refused(lambda file=file: read_key(file), file.name)
