"""However a campaign ends, the same command continues it and nothing is lost; two may write at
once."""

import json
import os
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import quadsim
from quadsim.campaign.store import Store
from quadsim.cli.cli import race
from tests.campaign_cases import FLIGHT, RACE, end_after, seeds_flown, start

MANY = 40  # attempts that are never all flown before the signal comes


def every(attempts):
    return [(sampler, seed) for sampler in ("colored", "gaussian") for seed in range(attempts)]


def flown(campaign):
    return [row[:2] for row in seeds_flown(campaign)]


def gone(group, patience=100):
    """Whether every process of the group ends, within 5 s."""
    for _ in range(patience):
        try:
            os.killpg(group, 0)
        except ProcessLookupError:
            return True
        time.sleep(0.05)
    return False


def finish(campaign, capsys, attempts=6):
    """The same command again, and the folders it left untouched."""
    before = seeds_flown(campaign)
    flags = ["--attempts", str(attempts), "--campaign", str(campaign), "--jobs", "1", "--json"]
    assert race(["compare", *FLIGHT, *flags]) == 0
    assert flown(campaign) == every(attempts)
    assert set(before) <= set(seeds_flown(campaign)), "what was kept is not flown again"
    return json.loads(capsys.readouterr().out)


def test_sigkill_then_the_same_command_continues(tmp_path, capsys):
    campaign = tmp_path / "c.sqlite"
    process = start(campaign, attempts=MANY)
    end_after(process, campaign, 3, signal.SIGKILL)
    assert process.wait() == -signal.SIGKILL
    assert 3 <= len(flown(campaign)) < 2 * MANY
    assert gone(process.pid), "the workers of a killed campaign go as well"
    said = finish(campaign, capsys, MANY)
    assert [(a["name"], a["attempts"], a["finished"]) for a in said["variants"]] == [
        ("gaussian", MANY, 0),
        ("colored", MANY, 0),
    ]
    assert said["campaign"] == str(campaign)
    assert said["pairs"][0]["seeds"] == MANY
    report = {path.suffix: path for path in (tmp_path / "c.report").iterdir()}
    assert set(report) == {".md", ".png", ".svg"}
    assert f"| gaussian | 0/{MANY} |" in report[".md"].read_text()
    assert report[".png"].read_bytes().startswith(b"\x89PNG")


def test_ctrl_c_is_one_line_and_exit_130_and_leaves_no_process(tmp_path):
    campaign = tmp_path / "c.sqlite"
    process = start(campaign, "--jobs", "1", attempts=MANY)
    end_after(process, campaign, 3, signal.SIGINT)
    out, err = process.communicate(timeout=30)
    assert process.returncode == 130
    assert out == ""
    assert (
        err.splitlines()[-1]
        == f"what has been flown is kept in {campaign}: the same command goes on there"
    )
    assert len(flown(campaign)) >= 3
    assert gone(process.pid), "no process stays behind"


def test_a_full_disk_is_one_line_then_the_same_command_continues(tmp_path, capsys):
    campaign = tmp_path / "c.sqlite"

    def little_room():  # no file may grow beyond this, as on a full disk
        resource.setrlimit(resource.RLIMIT_FSIZE, (60_000, 60_000))

    process = start(campaign, "--jobs", "1", preexec_fn=little_room)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 2
    assert "race compare: " in err.splitlines()[-1]
    assert "Traceback" not in err
    finish(campaign, capsys)


def test_two_campaigns_write_at_once_and_each_attempt_is_there_once(tmp_path):
    campaign = tmp_path / "c.sqlite"
    both = [start(campaign, "--jobs", "1", "--seed", seed) for seed in ("0", "3")]
    for process in both:
        _, err = process.communicate(timeout=60)
        assert process.returncode == 0, err
    assert flown(campaign) == [(s, seed) for s in ("colored", "gaussian") for seed in range(9)]
    with Store(campaign) as store:
        assert all((tmp_path / row.folder / "run.json").exists() for row in store.rows())


def test_results_lists_what_is_stored_and_compares_it_across_campaigns(tmp_path, capsys):
    one, two = (str(tmp_path / f"{name}.sqlite") for name in ("one", "two"))
    for campaign, seed in ((one, "0"), (two, "2")):
        argv = [
            "compare",
            *FLIGHT,
            "--attempts",
            "3",
            "--seed",
            seed,
            "--campaign",
            campaign,
            "--jobs",
            "1",
            "--json",
        ]
        assert race(argv) == 0
    capsys.readouterr()
    assert race(["results", "--campaigns", one, two, "--json"]) == 0
    variants = json.loads(capsys.readouterr().out)["variants"]
    assert [(a["name"], a["attempts"], a["seeds"]) for a in variants] == [
        ("gaussian", 5, "0-4"),
        ("colored", 5, "0-4"),
    ]
    assert race(["results", *(a["id"] for a in variants), "--campaigns", one, two, "--json"]) == 0
    (pair,) = json.loads(capsys.readouterr().out)["pairs"]
    assert pair["seeds"] == 5
    assert race(["results", "--campaigns", one, "--sampler", "smooth"]) == 0
    assert "no stored attempt matches" in capsys.readouterr().out


def test_a_comparison_with_other_flags_does_not_overwrite_the_report(tmp_path, capsys):
    campaign, reports = tmp_path / "c.sqlite", []
    for flags in (["--seed", "0"], ["--seed", "1"], ["--margin", ".3"], ["--seed", "0"]):
        argv = [
            "compare",
            *FLIGHT,
            *flags,
            "--attempts",
            "1",
            "--campaign",
            str(campaign),
            "--jobs",
            "1",
        ]
        assert race(argv) == 0
        reports.append(sorted(p.name for p in (tmp_path / "c.report").iterdir()))
    assert [len(names) for names in reports] == [3, 6, 9, 9], "the same command writes its own anew"


@pytest.mark.parametrize("out", ["file/report", "file"])
def test_where_the_report_cannot_be_written_nothing_is_flown(tmp_path, capsys, out):
    (tmp_path / "file").write_text("")
    campaign = tmp_path / "c.sqlite"
    assert (
        race(
            [
                "compare",
                *FLIGHT,
                "--out",
                str(tmp_path / out),
                "--campaign",
                str(campaign),
                "--jobs",
                "1",
            ]
        )
        == 2
    )
    assert capsys.readouterr().err.startswith(
        f"race compare: {tmp_path / out}: cannot write here: "
    )
    assert not campaign.exists()


def test_workers_do_not_import_what_lies_in_the_current_folder(tmp_path):
    for name in ("socket", "numpy", "random"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit('this is no module of Python')")
    command = [
        sys.executable,
        "-P",
        "-c",
        RACE[-1],
        "compare",
        *FLIGHT,
        "--attempts",
        "1",
        "--jobs",
        "1",
    ]
    root = str(Path(quadsim.__file__).parents[1])
    done = subprocess.run(
        command, cwd=tmp_path, env=os.environ | {"PYTHONPATH": root}, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr


def test_a_comparison_that_lost_all_its_attempts_is_one_line(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(
        "quadsim.campaign.runner.fly_all", lambda pool, specs: [(spec, None) for spec in specs]
    )
    argv = [
        "compare",
        *FLIGHT,
        "--attempts",
        "1",
        "--campaign",
        str(tmp_path / "c.sqlite"),
        "--jobs",
        "1",
    ]
    assert race(argv) == 2
    assert (
        capsys.readouterr().err.splitlines()[-1]
        == "race compare: no attempt was flown: nothing to compare"
    )
    assert not (tmp_path / "c.report").exists()
