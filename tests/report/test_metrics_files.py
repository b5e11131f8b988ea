from texgs.report.metrics_files import below


def test_copies_of_tracked_runs_and_jobs_at_work_are_no_results(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for folder in ("fuel/volume", "fuel/.views.work", "mlartifacts/0f3c/artifacts"):
        path = tmp_path / "results" / folder / "metrics.json"
        path.parent.mkdir(parents=True)
        path.write_text("{}")
    assert [path.as_posix() for path in below("results")] == ["results/fuel/volume/metrics.json"]
