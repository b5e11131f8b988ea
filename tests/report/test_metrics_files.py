from texgs.report.metrics_files import below


def test_copies_of_tracked_runs_and_jobs_at_work_are_no_results(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for folder in ("fuel/volume", "fuel/.views.work", "mlartifacts/0f3c/artifacts"):
        path = tmp_path / "results" / folder / "metrics.json"
        path.parent.mkdir(parents=True)
        path.write_text("{}")
    monkeypatch.chdir(tmp_path / "results" / "fuel" / ".views.work")
    assert len(below("../../../results")) == len(below(tmp_path / "results")) == 1, (
        "the folder's own name is free"
    )
    monkeypatch.chdir(tmp_path)
    assert [path.as_posix() for path in below("results")] == ["results/fuel/volume/metrics.json"]
