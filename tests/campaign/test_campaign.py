"""However a campaign ends, the same command continues it and nothing is lost; two may write at
once."""

import json
import multiprocessing as mp
import os
import resource
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest

import quadsim
from quadsim.campaign.flights.compare import identity
from quadsim.campaign.run import pool
from quadsim.campaign.run.pool import Pool
from quadsim.campaign.run.runner import Runner, Tally
from quadsim.campaign.run.store import Store
from quadsim.cli.cli import race
from tests.campaign_cases import (
    FLIGHT,
    end_after,
    seeds_flown,
    start,
    variant,
)

MANY = 6  # attempts that are never all flown before the signal comes
SAMPLERS = ("colored", "gaussian")


def every(seeds):
    return [(sampler, seed) for sampler in SAMPLERS for seed in seeds]


def flown_in(campaign):
    return [(sampler, seed) for sampler, seed, _ in seeds_flown(campaign)]


def gone(group, patience=100):
    """Return whether every process of the group ends within 5 s."""
    for _ in range(patience):
        try:
            os.killpg(group, 0)
        except ProcessLookupError:
            return True
        time.sleep(0.05)
    return False


def compare(campaign, *flags, attempts):
    return race(
        ["compare", *FLIGHT, "--attempts", str(attempts), "--campaign", str(campaign), *flags]
    )


@pytest.fixture
def in_this_process(monkeypatch):
    """Attempts fly here instead of in workers."""
    monkeypatch.setattr("quadsim.campaign.run.runner.open_pool", lambda *_: Pool())


@pytest.mark.compiled
@pytest.mark.process
def test_after_sigkill_the_same_command_continues(tmp_path, capsys, in_this_process):
    campaign = tmp_path / "c.sqlite"
    process = start(campaign, "--jobs", "1", attempts=MANY)
    end_after(process, campaign, 3, signal.SIGKILL)
    assert process.wait() == -signal.SIGKILL
    kept = seeds_flown(campaign)
    assert 3 <= len(kept) < 2 * MANY
    assert gone(process.pid), "the worker of a killed campaign goes as well"

    assert compare(campaign, "--json", attempts=MANY) == 0
    assert flown_in(campaign) == every(range(MANY))
    assert set(kept) <= set(seeds_flown(campaign)), "what was kept is not flown again"
    found = json.loads(capsys.readouterr().out)
    assert [(v["name"], v["attempts"]) for v in found["variants"]] == [
        ("gaussian", MANY),
        ("colored", MANY),
    ]
    assert found["pairs"][0]["seeds"] == MANY


@pytest.mark.regression
def test_ctrl_c_is_one_line_and_exit_130_and_leaves_no_process(tmp_path):
    campaign = tmp_path / "c.sqlite"
    process = start(campaign, "--jobs", "1", attempts=MANY)
    end_after(process, campaign, 3, signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 130
    assert out == ""
    assert str(campaign) in err.splitlines()[-1], "it says where the attempts are"
    assert "Traceback" not in err
    assert len(flown_in(campaign)) >= 3
    assert gone(process.pid), "no process stays behind"


# Both planners are compiled and kept before: with so little room no code could be kept.
@pytest.mark.usefixtures("_flown_campaign")
@pytest.mark.regression
def test_a_full_disk_is_one_line_then_the_campaign_continues(tmp_path):
    campaign = tmp_path / "c.sqlite"

    def little_room():  # no file may grow beyond this, as on a full disk
        resource.setrlimit(resource.RLIMIT_FSIZE, (60_000, 60_000))

    process = start(campaign, "--jobs", "1", preexec_fn=little_room)
    _, err = process.communicate(timeout=120)
    assert process.returncode == 2
    assert err.splitlines()[-1].startswith("race compare: ")
    assert "Traceback" not in err
    kept = seeds_flown(campaign)
    with Runner(campaign, jobs=0) as runner:
        runner([variant(sampler) for sampler in SAMPLERS], 6)
    assert flown_in(campaign) == every(range(6))
    assert set(kept) <= set(seeds_flown(campaign))


def fly_from(seed, campaign, flown):
    """Fly six seeds of both samplers from this one on; each flight is over at once."""
    pool.fly_attempt = lambda spec: replace(flown, run=replace(flown.run, spec=spec.record()))
    with Runner(campaign, jobs=0) as runner:
        runner([variant(sampler, seed=seed) for sampler in SAMPLERS], 6, quiet=True)


@pytest.mark.process
def test_two_campaigns_write_at_once_and_each_attempt_is_there_once(tmp_path, flown):
    campaign = tmp_path / "c.sqlite"
    fork = mp.get_context("fork")
    both = [fork.Process(target=fly_from, args=(seed, campaign, flown[1])) for seed in (0, 3)]
    for process in both:
        process.start()
    for process in both:
        process.join()
        assert process.exitcode == 0
    assert flown_in(campaign) == every(range(9))
    with Store(campaign) as store:
        assert all((tmp_path / row.folder / "run.json").exists() for row in store.rows())


IN_A_WORKER = """
from quadsim.campaign.run.pool import Processes, run_all
if __name__ == "__main__":
    with Processes(1) as pool:
        print(*run_all(pool, abs, [-1]))
"""


@pytest.mark.process
def test_workers_do_not_import_what_lies_in_the_current_folder(tmp_path):
    """Python begins a worker with the current folder on its path, unlike the script here."""
    script, here = tmp_path / "scripts" / "in_a_worker.py", tmp_path / "here"
    for folder in (script.parent, here):
        folder.mkdir()
    script.write_text(IN_A_WORKER)
    for name in ("socket", "numpy", "random"):
        (here / f"{name}.py").write_text("raise SystemExit('this is no module of Python')")
    done = subprocess.run(
        [sys.executable, str(script)],
        cwd=here,
        env=os.environ | {"PYTHONPATH": str(Path(quadsim.__file__).parents[1])},
        capture_output=True,
        text=True,
    )
    assert (done.returncode, done.stdout) == (0, "(-1, 1)\n"), done.stderr


@pytest.mark.compiled
def test_what_was_flown_before_is_compared_without_flying(campaign, capsys, monkeypatch):
    monkeypatch.setattr(
        "quadsim.campaign.run.runner.open_pool", lambda *_: pytest.fail("flown again")
    )
    before = seeds_flown(campaign)
    assert compare(campaign, attempts=3) == 0
    out = capsys.readouterr().out
    assert "colored - gaussian" in out
    assert seeds_flown(campaign) == before
    report = {path.suffix: path for path in (campaign.parent / "c.report").iterdir()}
    assert set(report) == {".md", ".json", ".png", ".svg"}
    assert "| gaussian | 0/3 |" in report[".md"].read_text()
    assert report[".png"].read_bytes().startswith(b"\x89PNG")


@pytest.mark.compiled
def test_stored_variants_are_listed_and_compared_across_campaigns(campaign, tmp_path, capsys):
    other = tmp_path / "other.sqlite"
    with Runner(other, jobs=0) as runner:
        runner([variant(sampler, seed=2) for sampler in ("gaussian", "colored")], 2)
    files = ["--campaigns", str(campaign), str(other)]
    assert race(["results", *files, "--json"]) == 0
    variants = json.loads(capsys.readouterr().out)["variants"]
    assert [(v["name"], v["attempts"], v["seeds"]) for v in variants] == [
        ("gaussian", 4, "0-3"),
        ("colored", 4, "0-3"),
    ], "an attempt that is in both counts once"
    assert race(["results", *(v["id"] for v in variants), *files, "--json"]) == 0
    (pair,) = json.loads(capsys.readouterr().out)["pairs"]
    assert pair["seeds"] == 4


@pytest.mark.compiled
def test_results_that_do_not_exist_are_said(campaign, capsys):
    assert race(["results", "--campaigns", str(campaign), "--sampler", "smooth"]) == 0
    assert "no stored attempt matches" in capsys.readouterr().out
    assert race(["results", "abcxyz", "--campaigns", str(campaign)]) == 2
    assert "'abcxyz'" in capsys.readouterr().err


def test_reports_of_comparisons_with_other_flags_have_other_names():
    again = [identity([variant(**settings)], 1) for settings in ({}, {})]
    others = [identity([variant(**settings)], 1) for settings in ({"seed": 1}, {"margin": 0.2})]
    assert again[0] == again[1], "the same command writes its own anew"
    assert len({*again, *others, identity([variant()], 2)}) == 4


def test_where_the_report_cannot_be_written_nothing_is_flown(tmp_path, capsys):
    (tmp_path / "file").write_text("")
    campaign = tmp_path / "c.sqlite"
    for out in ("file/report", "file"):
        assert compare(campaign, "--out", str(tmp_path / out), attempts=1) == 2
        assert str(tmp_path / out) in capsys.readouterr().err
        assert not campaign.exists()


def test_a_comparison_that_lost_all_its_attempts_is_one_line(
    tmp_path, capsys, monkeypatch, in_this_process
):
    monkeypatch.setattr(
        "quadsim.campaign.run.runner.fly_all", lambda pool, specs: [(spec, None) for spec in specs]
    )
    assert compare(tmp_path / "c.sqlite", attempts=1) == 2
    assert capsys.readouterr().err.splitlines()[-1].startswith("race compare: ")
    assert not (tmp_path / "c.report").exists()


def test_the_time_left_is_the_mean_time_of_an_attempt_times_their_number(capsys):
    with Tally(total=5, kept=1) as tally:
        (task,) = tally.tasks
        assert task.start_time is not None
        task.start_time -= 10.0
        tally.count("seed 0")
        tally.count("seed 1")
    lines = capsys.readouterr().err.splitlines()
    assert lines[-2:] == ["2/5 seed 0, 30 s left", "3/5 seed 1, 10 s left"]
