from texgs.core.kept import fingerprint, keep, recall


def test_what_is_kept_is_recalled_for_the_same_key_alone(tmp_path):
    path = tmp_path / "folder" / "plan.json"
    assert recall(path, "a") is None
    keep(path, "a", {"jobs": [1, None, "é"]})
    assert recall(path, "a") == {"jobs": [1, None, "é"]}
    assert recall(path, "b") is None
    for damaged in ("", "{", "[1]", '{"key": "a"}'):
        path.write_text(damaged)
        assert recall(path, "a") is None


def test_a_folder_that_cannot_be_written_to_is_no_error(tmp_path):
    (tmp_path / "file").write_text("")
    keep(tmp_path / "file" / "plan.json", "a", 1)
    assert recall(tmp_path / "file" / "plan.json", "a") is None


def test_fingerprints_differ_by_contents_and_names_but_not_by_what_python_compiled(tmp_path):
    (tmp_path / "below").mkdir()
    file = tmp_path / "below" / "a.py"
    file.write_text("1")
    fingerprints = {fingerprint(tmp_path)}
    (tmp_path / "__pycache__").mkdir()
    (tmp_path / "__pycache__" / "a.pyc").write_text("compiled")
    fingerprints.add(fingerprint(tmp_path))
    assert len(fingerprints) == 1
    file.write_text("2")
    fingerprints.add(fingerprint(tmp_path))
    file.rename(tmp_path / "b.py")
    fingerprints.add(fingerprint(tmp_path))
    assert len(fingerprints) == 3
