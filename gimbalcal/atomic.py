"""Files and folders that are written whole or not at all: made under another name on the same disk, then renamed."""

from __future__ import annotations

import errno
import fcntl
import json
import os
import re
import shutil
import signal
import tempfile
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from math import isfinite
from pathlib import Path
from typing import Any

FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
AT_FDCWD, RENAME_EXCHANGE = -100, 2  # AT_FDCWD and RENAME_EXCHANGE of renameat2(2)
OWN_FOLDERS = re.compile(r"new|whole|\.new-[a-z0-9_]{8}")  # of a folder that is being written
ENGINE_FULL = "os error"  # how an engine that is no Python's tells of the system


@contextmanager
def atomic_file(path: Path) -> Iterator[Path]:
    """Yield a name to write to in the folder of `path`, which takes its place when the block ends."""
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.name}.part")
    try:
        with _naming_full_disk(lambda _: path):
            yield temporary
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def write(path: Path, content: str | bytes) -> None:
    """Write a text (as UTF-8) or bytes, so that an interruption leaves the old file or none."""
    with atomic_file(path) as temporary:
        temporary.write_bytes(content.encode() if isinstance(content, str) else content)


def write_json(path: str | Path, content: Mapping[str, object] | Sequence[object]) -> None:
    """Write JSON, so that an interruption leaves the old file or none."""
    write(Path(path), as_json(content, indent=1))


def as_json(content: Any, indent: int | None = None) -> str:
    """Return JSON as every reader takes it: NaN and infinity, for which it has no word, are null."""
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
def atomic_folder(path: Path, last: str = "", belonging: Sequence[str] = ()) -> Iterator[Path]:
    """Yield a new folder to write files into, which becomes `path` when the block ends; nothing remains where it fails.

    What is written may have folders of its own. Where `path` is a folder already its files of the same names are
    replaced, those `belonging` to them go where no new one was made, and others stay. It is exchanged as one for its
    renewed copy, so that a kill at any moment leaves all old or all new ones. Where that cannot be (a system or disk
    without it, folders within that are not written, the folder that we stand in) they are replaced together, one
    renaming after the other, the one called `last` after all others.
    """
    home = path.resolve()
    # on the same disk, so that moving is renaming; no folder is left behind by what fails
    parent = home.parent if home.is_dir() and _exchangeable(home) else home
    parent = next(p for p in (parent, *parent.parents) if p.is_dir())
    for each in {parent, home.parent, home}:
        _remove_abandoned(each, home.name)
    private, lock = _hidden_folder(parent, home.name)
    try:
        new_folder = private / "new"
        new_folder.mkdir()  # as the mask lets others read it, which mkdtemp does not
        with _naming_full_disk(
            lambda reported: (
                path
                / (reported if reported and new_folder in reported.parents else _latest(new_folder)).relative_to(
                    new_folder
                )
            )
        ):
            yield new_folder
        if path.is_dir():
            _move_into(new_folder, path, last, belonging)
        else:
            path.parent.mkdir(parents=True, exist_ok=True)
            new_folder.rename(path)
    finally:
        shutil.rmtree(private, ignore_errors=True)
        os.close(lock)


def _hidden_folder(parent: Path, name: str) -> tuple[Path, int]:
    """Return a new hidden folder of this process, and the file descriptor that keeps it locked."""
    while True:
        private = Path(tempfile.mkdtemp(prefix=f".{name}-", dir=parent))
        with suppress(FileNotFoundError):  # another process removed it before it was locked
            lock = os.open(private, os.O_RDONLY)
            with suppress(OSError):  # a disk without locks, where no folder is ever taken for abandoned
                fcntl.flock(lock, fcntl.LOCK_EX)
            if private.is_dir():
                return private, lock
            os.close(lock)


def _remove_abandoned(parent: Path, name: str) -> None:
    """Remove the hidden folders of `hidden_folder` that killed processes left: nobody holds their locks any more."""
    pattern = re.compile(rf"\.{re.escape(name)}-[a-z0-9_]{{8}}")
    with suppress(OSError):
        for path in [p for p in parent.iterdir() if pattern.fullmatch(p.name) and p.is_dir() and not p.is_symlink()]:
            if all(OWN_FOLDERS.fullmatch(each.name) for each in path.iterdir()):
                lock = os.open(path, os.O_RDONLY)
                with suppress(OSError):
                    fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                    shutil.rmtree(path, ignore_errors=True)
                os.close(lock)


def _move_into(new_folder: Path, path: Path, last: str, belonging: Sequence[str]) -> None:
    """Move files into the folder `path`, all of them or none: no signal comes between."""
    every = [each.relative_to(new_folder) for each in new_folder.rglob("*")]
    files = sorted((e for e in every if not (new_folder / e).is_dir()), key=lambda e: (e.name == last, e))
    for each in every:
        if (path / each).exists() and (path / each).is_dir() != (new_folder / each).is_dir():
            number = errno.EISDIR if each in files else errno.ENOTDIR
            raise OSError(number, os.strerror(number), str(path / each))
    gone = {Path(name) for name in belonging if (path / name).is_file() and not (new_folder / name).exists()}
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM, signal.SIGHUP})
    try:
        if len(files) + len(gone) == 1 or not _exchange_whole(new_folder, path.resolve(), gone):
            for each in gone:
                (path / each).unlink()
            for each in files:
                (path / each).parent.mkdir(parents=True, exist_ok=True)
                (new_folder / each).replace(path / each)
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _exchange_whole(new_folder: Path, path: Path, gone: Collection[Path]) -> bool:
    """Return whether `new_folder` and the rest of `path` except `gone` took its place in one step."""
    if new_folder.parent.parent != path.parent or not _exchangeable(path):
        return False
    whole = new_folder.with_name("whole")
    try:
        if not _merge_folders(new_folder, path, whole, {path / each for each in gone}) or not _exchange_folders(
            whole, path
        ):
            return False
    except OSError:
        return False
    _keep_foreign(new_folder, whole, path, {whole / each for each in gone})
    return True


def _merge_folders(new_folder: Path, path: Path, whole: Path, gone: Collection[Path]) -> bool:
    """Make `whole` of `new_folder` and the rest of `path`; False where that cannot be, as with folders only in `path`.

    All are second names of the files, which take no room.
    """
    whole.mkdir()
    new = {each.name for each in new_folder.iterdir()}
    for each in new_folder.iterdir():
        if not each.is_dir():
            os.link(each, whole / each.name, follow_symlinks=False)
        elif not _merge_folders(each, path / each.name, whole / each.name, gone):
            return False
    if path.is_dir():
        shutil.copystat(path, whole)
        if whole.stat()[4:6] != path.stat()[4:6]:  # of another owner or group
            return False
        for each in (e for e in path.iterdir() if e.name not in new and e not in gone):
            if not each.is_dir():
                os.link(each, whole / each.name, follow_symlinks=False)
            elif not each.name.startswith(f".{path.name}-"):  # what a kill left of `atomic_folder`
                return False
    os.utime(whole)
    return True


def _keep_foreign(new_folder: Path, old: Path, path: Path, gone: Collection[Path]) -> None:
    """Move foreign files of the `old` folder into the one in its place: another process may have just saved one."""
    new = {each.name for each in new_folder.iterdir()}
    for each in old.iterdir():
        if each.name in new and each.is_dir():
            _keep_foreign(new_folder / each.name, each, path / each.name, gone)
        elif each.name not in new and each not in gone:
            each.replace(path / each.name)  # of the same file it does nothing


def _exchangeable(path: Path) -> bool:
    """Return whether the folder can be replaced by another: it is no mount point, and not the working directory."""
    ours = os.access(path.parent, os.W_OK | os.X_OK)
    return ours and not _is_mount_point(path) and not Path.cwd().is_relative_to(path)


def _is_mount_point(path: Path) -> bool:
    """Return whether a disk, or a folder of it, is mounted at that place."""
    with suppress(OSError):
        if f" {path} " in Path("/proc/self/mountinfo").read_text(errors="replace"):
            return True
    return path.is_mount()


def _exchange_folders(one: Path, other: Path) -> bool:
    """Exchange two folders in one step of the system, and return whether that was possible."""
    import ctypes  # not before: most of what is written needs none

    try:
        call = ctypes.CDLL(None).renameat2  # of Linux
    except (AttributeError, OSError):
        return False
    return bool(call(AT_FDCWD, os.fsencode(one), AT_FDCWD, os.fsencode(other), ctypes.c_uint(RENAME_EXCHANGE)) == 0)


def _latest(new_folder: Path) -> Path:
    """Return the file that was written last; of several within a tick of the clock the largest."""
    files = [(p.stat().st_mtime_ns, p.stat().st_size, p) for p in new_folder.rglob("*") if p.is_file()]
    return max(files, default=(0, 0, new_folder))[2]


@contextmanager
def _naming_full_disk(path: Callable[[Path | None], Path]) -> Iterator[None]:
    """Raise a full disk as one sentence with the name of the file, which the system reports only sometimes, an engine
    never.

    path: the file's name, given the one that is reported.
    """
    try:
        yield
    except OSError as problem:
        number = problem.errno or _error_number(problem)  # an engine may raise one without its number
        if number not in FULL:
            raise
        reported = Path(os.fsdecode(problem.filename)) if isinstance(problem.filename, (str, bytes)) else None
        raise OSError(number, os.strerror(number), str(path(reported))) from None
    except Exception as problem:
        if type(problem).__module__.partition(".")[0] != "polars" or not (number := _error_number(problem)):
            raise
        raise OSError(number, os.strerror(number), str(path(None))) from None


def _error_number(problem: Exception) -> int:
    """Return the system's number of an error from the words of an engine that is no Python's; zero for none."""
    numbers = re.findall(rf"{ENGINE_FULL} (\d+)", str(problem))
    return int(numbers[0]) if numbers else 0
