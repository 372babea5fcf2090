"""Long work says that it goes on, and stops saying so when it is done."""

import threading
import time

from gimbalcal.cli.options import _go_on, progress_on_stderr


def test_silence_is_broken_and_ends_with_the_work(capsys):
    done = threading.Event()
    doing = ["fitting the model (two of three)", time.monotonic()]
    worker = threading.Thread(target=_go_on, args=(doing, done, 0.02))
    worker.start()
    time.sleep(0.15)
    done.set()
    worker.join(1.0)
    assert not worker.is_alive()
    told = capsys.readouterr().err.splitlines()
    assert len(told) >= 2
    assert set(told) == {"  ... fitting the model: 0 s so far"}


def test_who_speaks_is_not_spoken_for(capsys):
    done = threading.Event()
    doing: list[object] = ["stage 1", time.monotonic()]
    worker = threading.Thread(target=_go_on, args=(doing, done, 5.0))
    worker.start()
    time.sleep(0.1)
    done.set()
    worker.join(1.0)
    assert capsys.readouterr().err == ""


def test_progress_has_the_units_of_the_answer_and_leaves_what_is_typed(capsys):
    progress = progress_on_stderr(False)
    for _ in range(2):
        progress('they scatter by 170 ug, 0.3 deg/sqrt(h): write sign = -1, `x -3 deg/s`, unit = "ug" in [deg/s]')
    progress("wrote ug/a -1/report.html")
    assert capsys.readouterr().err.splitlines() == [
        '  they scatter by 170 µg, 0.3 °/√h: write sign = -1, `x -3 deg/s`, unit = "ug" in [deg/s]',
        "  wrote ug/a -1/report.html",
    ]
