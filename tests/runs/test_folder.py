"""How a run is found by what a user types."""

from ddenv.runs.folder import BUNDLED_RUN, find_run, runs_folder


def test_a_bundle_is_its_run_but_a_stored_run_of_its_name_comes_first(tmp_path, home, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run, stored = tmp_path / "ditch-1" / BUNDLED_RUN, runs_folder() / "ditch-1.ddenv"
    run.parent.mkdir()
    assert find_run("ditch-1") == stored
    run.touch()
    assert find_run("ditch-1").samefile(run)
    stored.parent.mkdir(parents=True)
    stored.touch()
    assert find_run("ditch-1") == stored
    assert find_run(str(run.parent)) == run
