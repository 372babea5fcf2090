"""Files and folders that are written whole or not at all: made under another name on the same disk, then renamed."""

from __future__ import annotations

import errno
import json
import os
import re
import shutil
import signal
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from math import isfinite
from pathlib import Path
from typing import Any

FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
AT_HERE, EXCHANGE = -100, 2  # AT_FDCWD and RENAME_EXCHANGE of renameat2(2)
ENGINE_FULL = "os error"  # how an engine that is no Python's tells of the system


@contextmanager
def file(path: Path) -> Iterator[Path]:
    """A name to write to, beside `path`, that takes its place when the block ends; nothing is left where it fails."""
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.name}.part")
    try:
        with _naming(lambda _: path):
            yield temporary
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def write(path: Path, content: str | bytes) -> None:
    """Write a text (as UTF-8) or bytes, so that an interruption leaves the old file or none."""
    with file(path) as temporary:
        temporary.write_bytes(content.encode() if isinstance(content, str) else content)


def write_json(path: Path, content: Mapping[str, Any] | Sequence[Any]) -> None:
    """Write JSON, so that an interruption leaves the old file or none."""
    write(path, as_json(content, indent=1))


def as_json(content: Any, indent: int | None = None) -> str:
    """JSON as every reader takes it: numbers that are none, which it has no word for, are null."""
    try:
        return json.dumps(content, indent=indent, allow_nan=False)
    except ValueError:
        return json.dumps(_with_nulls(content), indent=indent, allow_nan=False)


def _with_nulls(content: Any) -> Any:
    if isinstance(content, Mapping):
        return {k: _with_nulls(v) for k, v in content.items()}
    if isinstance(content, (list, tuple)):
        return [_with_nulls(v) for v in content]
    return None if isinstance(content, float) and not isfinite(content) else content


@contextmanager
def folder(path: Path, last: str = "", belonging: Sequence[str] = ()) -> Iterator[Path]:
    """A new folder to write files into, which becomes `path` when the block ends; nothing is left where it fails.

    Where `path` is a folder already its files of the same names are replaced, those `belonging` to them go where no new
    one was made, and others stay. A folder of nothing but files is exchanged as one for its renewed copy, so that a
    kill at any moment leaves all old or all new ones. Where that cannot be (a system or disk without it, folders
    within, the folder that we stand in) they are replaced together, one renaming after the other, the one called `last`
    after all others.
    """
    home = path.resolve()
    # on the same disk, so that moving is renaming; no folder is left behind by what fails
    near = home.parent if home.is_dir() and _exchangeable(home) else home
    near = next(p for p in (near, *near.parents) if p.is_dir())
    private = Path(tempfile.mkdtemp(prefix=f".{home.name}-", dir=near))
    try:
        made = private / "new"
        made.mkdir()  # as the mask lets others read it, which mkdtemp does not
        with _naming(lambda told: path / (told if told and made in told.parents else _latest(made)).relative_to(made)):
            yield made
        if path.is_dir():
            _taken(made, path, last, belonging)
        else:
            path.parent.mkdir(parents=True, exist_ok=True)
            made.rename(path)
    finally:
        shutil.rmtree(private, ignore_errors=True)


def _taken(made: Path, path: Path, last: str, belonging: Sequence[str]) -> None:
    """Files into the folder `path`, all of them: no signal comes between; nothing is done where something cannot be."""
    files = sorted(made.iterdir(), key=lambda f: (f.name == last, f.name))
    for each in files:
        if (path / each.name).is_dir():
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path / each.name))
    gone = [path / name for name in belonging if (path / name).is_file() and not (made / name).exists()]
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM, signal.SIGHUP})
    try:
        if len(files) + len(gone) == 1 or not _exchanged(made, path.resolve(), [each.name for each in gone]):
            for each in gone:
                each.unlink()
            for each in files:
                each.replace(path / each.name)
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _exchanged(made: Path, path: Path, gone: Sequence[str]) -> bool:
    """Whether `made` and what else is in `path`, but for those `gone`, took its place in one step; if not, nothing."""
    if made.parent.parent != path.parent or not _exchangeable(path):
        return False
    whole = made.with_name("whole")
    try:
        whole.mkdir()
        shutil.copystat(path, whole)
        if whole.stat()[4:6] != path.stat()[4:6]:  # of another owner or group
            return False
        ours = {*gone, *(each.name for each in made.iterdir())}
        for each in (*made.iterdir(), *(e for e in path.iterdir() if e.name not in ours and not e.is_dir())):
            os.link(each, whole / each.name, follow_symlinks=False)  # a second name of the file, which takes no room
        os.utime(whole)
        if not _exchange(whole, path):
            return False
    except OSError:
        return False
    for each in whole.iterdir():  # which is the old one now
        if each.name not in ours:
            each.replace(path / each.name)  # of the same file it does nothing; another may just have saved a new one
    return True


def _exchangeable(path: Path) -> bool:
    """Whether another folder can take the place of this one: of files only, but for what a kill left of `folder`."""
    with os.scandir(path) as each:
        within = [e.name for e in each if e.is_dir() and not e.name.startswith(f".{path.name}-")]
    ours = os.access(path.parent, os.W_OK | os.X_OK)
    return ours and not within and not _mounted(path) and not Path().samefile(path)


def _mounted(path: Path) -> bool:
    """Whether a disk, or a folder of this one, is mounted at that place."""
    with suppress(OSError):
        if f" {path} " in Path("/proc/self/mountinfo").read_text(errors="replace"):
            return True
    return path.is_mount()


def _exchange(one: Path, other: Path) -> bool:
    """Two folders under each other's name in one step of the system; False where there is no such step."""
    import ctypes  # not before: most of what is written needs none

    try:
        call = ctypes.CDLL(None).renameat2  # of Linux
    except (AttributeError, OSError):
        return False
    return bool(call(AT_HERE, os.fsencode(one), AT_HERE, os.fsencode(other), ctypes.c_uint(EXCHANGE)) == 0)


def _latest(made: Path) -> Path:
    """The file that was written to last; of several within a tick of the clock the largest."""
    told = [(p.stat().st_mtime_ns, p.stat().st_size, p) for p in made.rglob("*") if p.is_file()]
    return max(told, default=(0, 0, made))[2]


@contextmanager
def _naming(path: Callable[[Path | None], Path]) -> Iterator[None]:
    """A full disk as one sentence with the name of the file, which the system tells only sometimes, an engine never.

    path: the file's name, given the one that is told.
    """
    try:
        yield
    except OSError as problem:
        number = problem.errno or _told(problem)  # an engine may raise one without its number
        if number not in FULL:
            raise
        told = Path(os.fsdecode(problem.filename)) if isinstance(problem.filename, (str, bytes)) else None
        raise OSError(number, os.strerror(number), str(path(told))) from None
    except Exception as problem:
        if type(problem).__module__.partition(".")[0] != "polars" or not (number := _told(problem)):
            raise
        raise OSError(number, os.strerror(number), str(path(None))) from None


def _told(problem: Exception) -> int:
    """The system's number of an error in the words of an engine that is no Python's; zero for none."""
    found = re.findall(rf"{ENGINE_FULL} (\d+)", str(problem))
    return int(found[0]) if found else 0
