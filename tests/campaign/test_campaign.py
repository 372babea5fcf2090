"""Campaigns: the same digits from any number of workers, after a death, after a stop, and on a cluster."""

import json
import os
import subprocess
import sys
import time
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from signal import SIGKILL

import numpy as np
import polars as pl
import pytest

from gimbalcal.calibration.matrices import matrices
from gimbalcal.campaign import run_campaign
from gimbalcal.campaign import workers as campaign_workers
from gimbalcal.campaign.campaign_folder import CampaignFolder
from gimbalcal.campaign.monte_carlo import lost_share
from gimbalcal.campaign.task import Task, _comparable_truth, compute_runs, seed_of, task
from gimbalcal.campaign.workers import compute_in_process, compute_in_processes, connect
from gimbalcal.effects import parameters
from gimbalcal.effects.accelerometer import Misalignment, angles_of
from gimbalcal.effects.effect import MISALIGNMENT_AXES, without_gauge
from gimbalcal.effects.gyroscope import GyroMisalignment
from gimbalcal.errors import InputError
from gimbalcal.simulate.scenario import find
from tests.campaign.deadly import always_dies, dies_once

PULSES = "wang2019-accelerometers-3arcmin"
SHARES = [range(i, i + 10) for i in range(0, 50, 10)]
WRONG_TRUTH = find("wu2018-18").read_text(encoding="utf-8") + "\n[truth.wobble]\nx = 1.0\n"


def small(name=PULSES):
    return replace(task(PULSES), name=name, share=10)


def collected(results):
    return {share.start: columns["estimate"] for share, columns in results}


def test_workers_and_a_death_change_no_digit(tmp_path):
    alone = collected(compute_in_process(partial(compute_runs, small()), SHARES))
    marker = str(tmp_path / "marker")
    assert collected(compute_in_processes(partial(dies_once, small(marker)), SHARES, 2, lost_share)) == alone
    assert Path(marker).exists()


def test_a_share_that_keeps_killing_workers_is_named():
    with pytest.raises(InputError, match="runs 20 to 29 ended their worker 3 times"):
        collected(compute_in_processes(partial(always_dies, small()), SHARES, 2, lost_share))


def test_one_file_with_the_statistics_of_the_bench(tmp_path):
    told: list[str] = []
    summary = run_campaign(PULSES, 150, tmp_path / "c", workers=2, progress=told.append)
    rows = pl.read_parquet(tmp_path / "c" / "campaign.parquet")
    assert sorted(p.name for p in (tmp_path / "c").iterdir()) == ["campaign.json", "campaign.parquet"]
    assert rows["run"].to_list() == np.repeat(np.arange(150), 15).tolist()
    assert told[-1].startswith("150 of 150 runs")
    assert summary.to_dict() == json.loads((tmp_path / "c" / "campaign.json").read_text())
    # rms of 150 normal errors: 6 %, and the drawn scale factors weigh the runs: 4 sigma
    assert all(abs(row["ratio"] - 1) < 0.3 for row in summary["parameters"])


def test_more_runs_are_added_to_a_finished_campaign(tmp_path):
    run_campaign(PULSES, 100, tmp_path / "c", workers=1)
    told: list[str] = []
    run_campaign(PULSES, 200, tmp_path / "c", workers=1, progress=told.append)
    assert told[0] == "100 of 200 runs were there already"
    run_campaign(PULSES, 200, tmp_path / "d", workers=1)
    assert table(tmp_path / "c").equals(table(tmp_path / "d"))


def test_a_killed_campaign_goes_on_where_it_was(tmp_path):
    code = (
        "import time\nfrom pathlib import Path\nfrom gimbalcal.campaign import run_campaign\n"
        f"run_campaign({PULSES!r}, 400, Path({str(tmp_path / 'c')!r}), workers=1, progress=lambda _: time.sleep(0.5))\n"
    )
    process = subprocess.Popen([sys.executable, "-c", code])
    parts = tmp_path / "c" / "campaign.parts"
    wait_for(lambda: parts.is_dir() and len(list(parts.glob("*.parquet"))) >= 1)
    process.kill()
    process.wait()
    assert not (tmp_path / "c" / "campaign.parquet").exists()
    told: list[str] = []
    run_campaign(PULSES, 400, tmp_path / "c", workers=1, progress=told.append)
    assert "of 400 runs were there already" in told[0]
    run_campaign(PULSES, 400, tmp_path / "d", workers=1)
    assert table(tmp_path / "c").equals(table(tmp_path / "d"))


def table(folder):
    return pl.read_parquet(folder / "campaign.parquet")


def wait_for(condition, seconds=30.0):
    assert callable(condition)
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.02)


@contextmanager
def dask_cluster(folder):
    """The address of a scheduler on loopback, and the processes of two workers and of the scheduler."""
    contact = folder / "scheduler.json"
    env = os.environ | {"OPENBLAS_NUM_THREADS": "1", "PYTHONPATH": str(Path.cwd())}

    def start(program, *options):
        command = [sys.executable, "-m", f"distributed.cli.{program}", "--scheduler-file", str(contact), *options]
        return subprocess.Popen(command, env=env, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    scheduler = start("dask_scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard")
    workers: list[subprocess.Popen[bytes]] = []
    try:
        wait_for(lambda: contact.is_file() and contact.read_text())  # it exists before it is written
        plain = ("--nthreads", "1", "--no-nanny", "--no-dashboard", "--local-directory", str(folder))
        workers += [start("dask_worker", *plain) for _ in range(2)]
        yield json.loads(contact.read_text())["address"], (*workers, scheduler)
    finally:
        for process in (*workers, scheduler):
            process.kill()
            process.wait()


@pytest.mark.slow
def test_a_cluster_gives_the_same_digits_though_one_worker_is_killed(tmp_path):
    with dask_cluster(tmp_path) as (address, workers):
        with connect(address) as client:
            client.wait_for_workers(2, timeout=30)
        told: list[str] = []

        def kill_one(words):
            told.append(words)
            if len(told) == 3:
                os.kill(workers[0].pid, SIGKILL)

        run_campaign(PULSES, 2000, tmp_path / "c", scheduler=address, progress=kill_one)
        assert workers[0].wait(timeout=10) == -SIGKILL
    run_campaign(PULSES, 2000, tmp_path / "d", workers=1)
    assert table(tmp_path / "c").equals(table(tmp_path / "d"))
    assert told[-1].startswith("2000 of 2000 runs")


def test_no_scheduler_is_one_sentence():
    with pytest.raises(InputError, match=r"no Dask scheduler answers at tcp://127\.0\.0\.1:1 within 0\.5 s"):
        connect("tcp://127.0.0.1:1", timeout=0.5)


@pytest.mark.slow
def test_a_cluster_without_workers_or_that_goes_away_is_one_sentence(tmp_path, monkeypatch):
    monkeypatch.setattr(campaign_workers, "PATIENCE", 1.0)
    with dask_cluster(tmp_path) as (address, (*workers, _)):
        with connect(address) as client:
            client.wait_for_workers(2, timeout=30)

        def kill_all(words):
            for each in workers:
                each.kill()

        with pytest.raises(InputError, match="has no worker left; finished runs are kept"):
            run_campaign(PULSES, 4000, tmp_path / "c", scheduler=address, progress=kill_all)
        for each in workers:
            each.wait()
        with pytest.raises(InputError, match="has no worker; start some"):
            run_campaign(PULSES, 4000, tmp_path / "c", scheduler=address)
    told: list[str] = []
    run_campaign(PULSES, 4000, tmp_path / "c", workers=1, progress=told.append)
    assert "of 4000 runs were there already" in told[0]


def test_damaged_shares_are_computed_again(tmp_path):
    rng = np.random.default_rng(1)
    whole = task(PULSES)
    sound = CampaignFolder(tmp_path / "d", whole, 300)
    sound.open()
    for share in sound.shares():
        sound.keep(share, next(compute_in_process(partial(compute_runs, whole), [share]))[1])
    names = sorted(p.name for p in sound.parts.glob("*.parquet"))
    for part in sound.parts.glob("*.parquet"):
        content = bytearray(part.read_bytes())
        if rng.random() < 0.5:
            content[int(rng.integers(len(content)))] ^= 4
        else:
            del content[int(rng.integers(len(content))) :]
        part.write_bytes(bytes(content))
    assert sound.open() == sound.shares()
    run_campaign(PULSES, 300, tmp_path / "d", workers=1)
    run_campaign(PULSES, 300, tmp_path / "e", workers=1)
    assert len(names) == 3
    files = ("campaign.json", "campaign.parquet")
    assert all((tmp_path / "d" / f).read_bytes() == (tmp_path / "e" / f).read_bytes() for f in files)
    (tmp_path / "d" / files[1]).write_bytes(b"PAR1 no more")  # a finished one that was damaged begins anew
    run_campaign(PULSES, 300, tmp_path / "d", workers=1)
    assert table(tmp_path / "d").equals(table(tmp_path / "e"))


def test_two_campaigns_in_one_folder_at_once_are_told_apart(tmp_path):
    first = CampaignFolder(tmp_path / "c", task(PULSES), 100)
    with first.alone():
        first.open()
        with pytest.raises(InputError, match="another campaign is at work in"):
            run_campaign(PULSES, 100, tmp_path / "c", workers=1)
        assert first.parts.is_dir()
    run_campaign(PULSES, 100, tmp_path / "c", workers=1)


def test_a_killed_parent_leaves_no_worker(tmp_path):
    code = (
        "from pathlib import Path\nfrom gimbalcal.campaign import run_campaign\n"
        f"if __name__ == '__main__':\n    run_campaign({PULSES!r}, 100000, Path({str(tmp_path / 'c')!r}), workers=2)\n"
    )
    (tmp_path / "go.py").write_text(code)
    process = subprocess.Popen([sys.executable, str(tmp_path / "go.py")], start_new_session=True)
    wait_for(lambda: len(list((tmp_path / "c").glob("campaign.parts/*.parquet"))) >= 1)
    assert len(of_session(process.pid)) >= 3
    process.kill()
    process.wait()
    wait_for(lambda: not of_session(process.pid), 10.0)


def of_session(session):
    """Processes of a session, by /proc: its number is the sixth word of stat."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            words = stat.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(words[3]) == session and words[0] != "Z":
            found.append(int(stat.parent.name))
    return found


def test_a_simulated_scenario_is_calibrated_run_by_run(tmp_path):
    summary = run_campaign("wu2018-18", 3, tmp_path / "c", workers=1, method="multiposition")
    assert summary["runs"] == 3
    assert summary["direction"] == "physics to readings"
    by_name = {row["parameter"]: row for row in summary["parameters"]}
    # three runs: an rms of three normal errors exceeds 3 sigma once in 1e5
    assert all(row["ratio"] < 3 for name, row in by_name.items() if name.startswith(("bias", "scale_factor")))


def test_errors_of_a_static_run_from_all_of_the_prior_are_as_large_as_their_sigmas():
    """Also where the platform was turned by hundreds of arcsec: 2.5 to 10 sigmas, counted from another S_t."""
    text = """
format = 1
kind = "static-run"
[site]
latitude = { value = 40.0, unit = "deg" }
[platform]
name = "space-stable"
[schedule]
duration = { value = 30.0, unit = "h" }
rate = { value = 0.0008333333333333334, unit = "Hz" }
start_angle = { value = 25.0, unit = "deg" }
[noise]
accelerometer = { value = 4.0, unit = "ug" }
gimbal_angle = { value = 0.5, unit = "arcsec" }
attitude = { value = 0.5, unit = "arcsec" }
[truth]
draw = true
"""
    made = compute_runs(Task("turned", text, "static-run", 5, "three-stage", 4), range(8))
    assert not any(made["outcome"])
    z = (np.array(made["estimate"]) - np.array(made["truth"])) / np.array(made["sigma"])
    names = np.array(made["parameter"])
    assert 0.8 < np.sqrt(np.mean(z**2)) < 1.2  # 200 errors, correlated by their null directions
    for name in ("phi_0:polar", "phi_0:equatorial_x", "phi_0:equatorial_y", "misalignment:xz"):
        assert np.sqrt(np.mean(z[names == name] ** 2)) < 1.8  # of eight, once in two thousand


def test_truth_is_turned_into_the_frame_of_the_estimate():
    """The frame whose x lies along the first input axis and y in the plane of the first two, for both triads."""
    rng = np.random.default_rng(2)
    beta, gamma = 1e-4 * rng.standard_normal((2, 6))
    truth = (Misalignment(beta=beta), GyroMisalignment(beta=gamma))
    wanted = without_gauge([p for e in truth for p in parameters(type(e))])
    found = {p.label: x for p, x in zip(wanted, _comparable_truth(truth, wanted, "multiposition"), strict=True)}
    m = matrices(truth)
    # M = L Q with L lower triangular: Q carries the drawing's frame into the one of the estimate
    Q = np.linalg.qr(m["Ma"].T)[0].T
    Q = Q * np.sign(np.diag(Q))[:, None]
    lower, gyro = m["Ma"] @ Q.T, m["Mg"] @ Q.T
    # products of two misalignments, 1e-8
    assert found["misalignment:yz"] == pytest.approx(-lower[1, 0], abs=1e-7)
    assert found["misalignment:zy"] == pytest.approx(lower[2, 0], abs=1e-7)
    assert found["misalignment:zx"] == pytest.approx(-lower[2, 1], abs=1e-7)
    for axis, angle in zip(MISALIGNMENT_AXES, angles_of(gyro), strict=True):
        assert found[f"gyro_misalignment:{axis}"] == pytest.approx(angle, abs=1e-7)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('kind = "accelerometer-pulses"\n', 'give the turntable error as turntable = { value = 3.0, unit = "arcsec" }'),
        ('kind = "gyroscope-pulses"\nspeed = 1\n', "'speed' is not known; a scenario of pulses has"),
        ('kind = "gyroscope-pulses"\nturntable = { value = 3.0, unit = "kg" }\n', "the unit 'kg' is not known"),
        ('kind = "gyroscope-pulses"\nseed = -1\n', "seed must be a whole number from 0, got -1"),
        ("kind = \n", "this line is not valid TOML"),
        (WRONG_TRUTH, "truth.wobble: no effect has this id"),
    ],
)
def test_a_wrong_scenario_is_refused_and_nothing_written(text, words, tmp_path):
    path = tmp_path / "s.toml"
    path.write_text(text)
    with pytest.raises(InputError) as refused:
        run_campaign(path, 3, tmp_path / "c")
    assert words in str(refused.value)
    assert not (tmp_path / "c").exists()


def test_another_campaign_in_the_same_folder_is_refused(tmp_path):
    run_campaign(PULSES, 2, tmp_path / "c", workers=1)
    with pytest.raises(InputError, match=r"holds another campaign .* give another --out"):
        run_campaign(PULSES, 2, tmp_path / "c", workers=1, seed=7)
    with pytest.raises(InputError, match="-n must be at least 1, got 0"):
        run_campaign(PULSES, 0, tmp_path / "c")


def test_another_campaign_gives_way_when_asked_and_nothing_else_does(tmp_path):
    run_campaign(PULSES, 2, tmp_path / "c", workers=1)
    (tmp_path / "c" / "mine.txt").write_text("stays")
    told: list[str] = []
    run_campaign(PULSES, 2, tmp_path / "c", workers=1, progress=told.append, overwrite=True)
    assert told[0] == "2 of 2 runs were there already"  # its own runs are no others
    made = run_campaign(PULSES, 2, tmp_path / "c", workers=1, seed=7, overwrite=True)
    assert made["identity"]["seed"] == 7
    assert (tmp_path / "c" / "mine.txt").read_text() == "stays"
    (tmp_path / "c" / "campaign.json").write_text("{")
    run_campaign(PULSES, 2, tmp_path / "c", workers=1, seed=7, overwrite=True)
    assert json.loads((tmp_path / "c" / "campaign.json").read_text())["runs"] == 2


def test_seeds_of_runs_do_not_repeat():
    assert len({seed_of(s, r) for s in range(20) for r in range(500)}) == 10000
