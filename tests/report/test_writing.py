"""A save that fails: the older file is as it was, nothing is left behind, the report can be saved elsewhere."""

import errno
import os
import resource
import stat
import subprocess

import numpy as np
import pytest

from exudyn_romerr import InputError, load_report
from tests.helpers.theorem import random_case

ROOM = 4096  # bytes; a report of the case below takes several times that


@pytest.fixture(scope="module")
def report():
    """A small report."""
    return random_case(1, steps=40).report(estimators=("fast", "energy"))


@pytest.fixture
def older(report, tmp_path):
    """A file that is there already, in a folder of its own."""
    path = tmp_path / "run.npz"
    report.save(path)
    assert path.stat().st_size > 2 * ROOM
    return path


@pytest.fixture
def small_files():
    """The system itself refuses to write more than ROOM bytes to a file."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (ROOM, hard))
    yield lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@pytest.fixture
def tiny_disk(tmp_path):
    """A disk of 96 kB: a report takes less than half of it."""
    folder = tmp_path / "disk"
    folder.mkdir()
    try:
        mount = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=96k", "none", folder], capture_output=True)
    except FileNotFoundError:
        pytest.skip("no mount here")
    if mount.returncode:
        pytest.skip("no permission to mount a disk")
    yield folder
    subprocess.run(["umount", folder], check=True)


def interrupted_at(monkeypatch, room, error):
    """Let saving fail with an error after some bytes."""
    original = np.savez_compressed

    def savez(stream, **arrays):
        write = stream.write

        class Full:
            def write(self, data):
                if stream.tell() + len(data) > room:
                    write(memoryview(data).cast("B")[: room - stream.tell()])
                    raise error
                return write(data)

            def __getattr__(self, name):
                return getattr(stream, name)

        original(Full(), **arrays)

    monkeypatch.setattr(np, "savez_compressed", savez)


def check_as_it_was(older, before, report):
    """The older file is the same, alone in its folder, and readable; the report is complete."""
    assert older.read_bytes() == before
    assert [path.name for path in older.parent.iterdir()] == [older.name]
    assert str(load_report(older)) == str(report)


@pytest.mark.parametrize("room", [0, 100, ROOM])
def test_disk_that_is_full_midway(report, older, monkeypatch, room, tmp_path_factory):
    """At the first byte, in the first array, later on."""
    before = older.read_bytes()
    with monkeypatch.context() as patch:
        interrupted_at(patch, room, OSError(errno.ENOSPC, "No space left on device"))
        with pytest.raises(InputError, match=r"run\.npz.*No space left.*as it was: make room, or") as caught:
            report.save(older)
    assert isinstance(caught.value.__cause__, OSError)
    check_as_it_was(older, before, report)
    elsewhere = tmp_path_factory.mktemp("elsewhere") / "run.npz"
    report.save(elsewhere)
    assert str(load_report(elsewhere)) == str(report)


def test_interrupt_midway(report, older, monkeypatch):
    """Ctrl-C is no InputError, but leaves nothing behind either."""
    before = older.read_bytes()
    interrupted_at(monkeypatch, ROOM, KeyboardInterrupt())
    with pytest.raises(KeyboardInterrupt):
        report.save(older)
    check_as_it_was(older, before, report)


@pytest.mark.parametrize("there", [True, False])
def test_file_that_the_system_does_not_let_grow(report, older, small_files, there):
    """Refused by the system, in mid-file."""
    before, path = older.read_bytes(), older if there else older.with_name("new.npz")
    with pytest.raises(InputError, match=f"{path.name}.*{os.strerror(errno.EFBIG)}.*as it was: pass another path"):
        report.save(path)
    check_as_it_was(older, before, report)
    small_files()
    report.save(path)
    assert str(load_report(path)) == str(report)


def fill(path):
    """Write until the disk is full."""
    with path.open("wb") as stream:
        while stream.write(bytes(ROOM)):
            stream.flush()


def test_disk_that_is_full(report, tiny_disk):
    """A real one, with an older file on it and no room for another."""
    older = tiny_disk / "run.npz"
    report.save(older)
    before, filler = older.read_bytes(), tiny_disk / "filler"
    with pytest.raises(OSError, match="No space"):
        fill(filler)
    with pytest.raises(InputError, match=r"run\.npz.*No space left.*make room"):
        report.save(older)
    filler.unlink()
    check_as_it_was(older, before, report)
    report.save(older)


@pytest.fixture
def full_device(tmp_path):
    """A device as /dev/full, of our own where that may be made."""
    path = tmp_path / "full"
    try:
        os.mknod(path, stat.S_IFCHR | 0o666, os.makedev(1, 7))
        path.open("wb").close()
    except OSError:
        return "/dev/full"
    return path


def test_device_is_written_to_and_not_replaced(report, full_device):
    """It refuses every byte."""
    with pytest.raises(InputError, match=r"/full.*No space left"):
        report.save(full_device)
    assert stat.S_ISCHR(os.stat(full_device).st_mode)


@pytest.mark.parametrize(
    ("path", "why"),
    [("missing/run.npz", "folder '.*missing' does not exist: make it, or"), (".", "it is a folder")],
)
def test_path_that_cannot_be_written(report, tmp_path, path, why):
    """No such folder; a folder."""
    with pytest.raises(InputError, match=f"cannot be written: {why}"):
        report.save(tmp_path / path)
    assert list(tmp_path.iterdir()) == []


def test_link_and_mode_are_kept(report, older):
    """The file that a link points to is replaced, not the link; who may read it stays the same."""
    link = older.with_name("link.npz")
    link.symlink_to(older.name)
    older.write_bytes(b"old")
    older.chmod(0o640)
    report.save(link)
    assert link.is_symlink()
    assert stat.S_IMODE(older.stat().st_mode) == 0o640
    assert str(load_report(older)) == str(report)


def test_new_file_is_made_as_any_other(report, tmp_path):
    """With the permissions that open() gives."""
    (tmp_path / "other").write_bytes(b"")
    report.save(tmp_path / "run.npz")
    assert (tmp_path / "run.npz").stat().st_mode == (tmp_path / "other").stat().st_mode
