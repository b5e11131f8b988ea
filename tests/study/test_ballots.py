"""Ballots as the page saves them, and what is wrong with others."""

import pytest

from tests.refusals import refused
from tests.study.studies import study
from texgs.study.ballots import read_ballot, read_votes, votes_beside
from texgs.study.questions import write_key

STUDY = study("xyz", "zy")
LINES = ["1,A,2", "1,B,3", "1,C,1", "2,A,1", "2,B,2"]


def ballot(folder, lines=LINES, name="aa", study=STUDY.study, file=None):
    path = folder / (file or f"ballot-{name}.csv")
    rows = "".join(f"{study},{name},{line}\n" for line in lines)
    path.write_text(f"study,ballot,question,option,rank\n{rows}")
    return path


def test_ballots_are_read_in_the_order_of_their_ids(tmp_path):
    paths = [ballot(tmp_path, name="bb", file="1.csv"), ballot(tmp_path, LINES[::-1], "aa", file="2.csv")]
    votes = read_votes(STUDY, paths)
    assert [each.ballot for each in votes.ballots] == ["aa", "bb"]
    assert votes.ballots[0].ranks == votes.ballots[1].ranks == [[2, 3, 1], [1, 2]]


def test_a_spreadsheet_may_have_saved_it(tmp_path):
    path = ballot(tmp_path)
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes().replace(b"\n", b"\r\n"))
    assert read_ballot(STUDY, path).ranks == [[2, 3, 1], [1, 2]]


def test_the_ballots_beside_a_key_are_counted(tmp_path):
    key = tmp_path / "key.json"
    assert votes_beside(key) is None
    write_key(key, STUDY)
    assert votes_beside(key) is None
    (tmp_path / "votes").mkdir()
    ballot(tmp_path / "votes")
    assert [each.ranks for each in votes_beside(key).ballots] == [[[2, 3, 1], [1, 2]]]


@pytest.mark.parametrize(
    ("lines", "key"),
    [
        (LINES[:2] + LINES[3:], "question 1: .*got A 2, B 3;"),
        (["1,A,2", "1,B,2", "1,C,1", *LINES[3:]], "question 1: .*B 2"),
        (["1,A,2", "1,B,3", "1,C,0", *LINES[3:]], "question 1: .*C 0"),
        (["1,A,2", "1,B,3", "1,C,best", *LINES[3:]], "question 1: .*C best"),
        (LINES[:3], "question 2: .*got none;"),
        ([*LINES, "2,C,3"], "question 2: .*got A 1, B 2, C 3;"),
        ([*LINES, "3,A,1"], "question 3"),
        ([*LINES, "2,B,2"], "question 2: .*got A 1, B 2, B 2;"),
        ([], "study, ballot, question, option, rank"),
        (["1;A;1"], "study, ballot, question, option, rank"),
    ],
)
def test_an_incomplete_ballot_is_refused(tmp_path, lines, key):
    refused(lambda: read_ballot(STUDY, ballot(tmp_path, lines)), rf"ballot-aa\.csv: .*{key}")


def test_a_ballot_of_another_study_one_that_is_there_twice_and_other_files_are_refused(tmp_path):
    paths = [ballot(tmp_path, file="one.csv"), ballot(tmp_path, file="two.csv")]
    assert len(read_votes(STUDY, paths).ballots) == 1, "a download that was saved again"
    paths.append(ballot(tmp_path, ["1,A,1", "1,B,2", "1,C,3", *LINES[3:]], file="x.csv"))
    refused(lambda: read_votes(STUDY, paths), r"x\.csv: .*two\.csv")
    ballot(tmp_path, study="ffff", file="other.csv")
    both = paths[0].read_text() + ballot(tmp_path, name="bb").read_text().partition("\n")[2]
    (tmp_path / "both.csv").write_text(both)
    (tmp_path / "picture.csv").write_bytes(b"\x89PNG\r\n\xff\xfe")
    (tmp_path / "long.csv").write_text("study\n" * 300_000)
    for name in ("other", "both", "picture", "long", "none"):
        refused(lambda name=name: read_ballot(STUDY, tmp_path / f"{name}.csv"), rf"{name}\.csv: ")
