"""The guard before every HDF5 file: nothing outside the file is opened, nothing out of proportion is read."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

from aatri.errors import ArtifactError
from aatri.tables import hdf5
from aatri.tables.hdf5 import read, read_header, read_plain, read_warnings, write
from tests.made_up_stages import Numbers, Values
from tests.tables.hostile_hdf5 import CHANGES, NOT_OF_THE_HEADER

COLUMN = "values/value"
SECRET = b"TOP SECRET TOKEN"


@pytest.fixture
def path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    with h5py.File("secret.h5", "w") as file:
        file["secret"] = np.frombuffer(SECRET, "u1")
    write(Numbers(values=Values(value=np.arange(8.0))), tmp_path / "n.h5", ["told"])
    return tmp_path / "n.h5"


@pytest.mark.parametrize("how", CHANGES)
def test_a_file_made_to_harm_is_refused_by_every_reader(path: Path, how: str) -> None:
    with h5py.File(path, "r+") as file:
        CHANGES[how](file, COLUMN)
    for reader in (lambda p: read(p, Numbers), read_header, read_plain, read_warnings):
        if reader is not read_header and how in NOT_OF_THE_HEADER and reader in (read_plain, read_warnings):
            continue
        if reader is read_header and how in NOT_OF_THE_HEADER:
            assert "kind" in read_header(path)
            continue
        with pytest.raises(ArtifactError) as caught:
            reader(path)
        assert caught.value.exit_code == 7
        assert str(path) in caught.value.where
        assert SECRET.decode() not in str(caught.value)


@pytest.mark.parametrize("how", [name for name in CHANGES if name not in NOT_OF_THE_HEADER])
def test_show_tells_of_a_file_made_to_harm_without_an_internal_error(path: Path, how: str) -> None:
    from typer.testing import CliRunner

    from aatri.cli.main import app

    with h5py.File(path, "r+") as file:
        CHANGES[how](file, COLUMN)
    for more in ([], ["--json"]):
        told = CliRunner().invoke(app, ["show", str(path), *more])
        assert told.exit_code == 7, told.stderr
        assert "internal error" not in told.stderr


def test_what_artifacts_are_made_of_passes(path: Path) -> None:
    assert read(path, Numbers).values.value.tolist() == list(range(8))
    assert read_warnings(path) == ("told",)
    with h5py.File(path, "r+") as file:  # repacked by other tools
        del file[COLUMN]
        file["values"].create_dataset("value", data=np.arange(8.0), chunks=(8,), compression="gzip", shuffle=True)
    assert read(path, Numbers).values.value.tolist() == list(range(8))


def test_a_pipe_and_a_folder_do_not_hang_the_reader(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.h5")
    (tmp_path / "folder.h5").mkdir()
    for name, what in (("pipe", "a pipe"), ("folder", "a folder")):
        with pytest.raises(ArtifactError, match=what):
            read_header(tmp_path / f"{name}.h5")


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="the peak of memory is read from /proc")
def test_no_other_file_is_opened_and_little_memory_taken(path: Path) -> None:
    """In a process of 1 GB of address space, with the other file removed: the refusal comes from the guard."""
    for how in ("terabytes", "giant_chunk", "bomb"):
        write(Numbers(values=Values(value=np.arange(8.0))), path.with_name(f"{how}.h5"))
        with h5py.File(path.with_name(f"{how}.h5"), "r+") as file:
            CHANGES[how](file, COLUMN)
        code = (
            "from pathlib import Path; from aatri.tables.hdf5 import read_plain;"
            "from aatri.errors import ArtifactError\n"
            f"try: read_plain(Path({how + '.h5'!r}))\n"
            "except ArtifactError as e: print(e)\n"
            "status = Path('/proc/self/status').read_text()\n"  # ru_maxrss would begin with that of this process
            "print(status.split('VmHWM:')[1].split()[0])"
        )
        told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
        assert "declares" in told
        assert int(told.splitlines()[-1]) < 400_000


def test_attributes_that_are_not_finite_are_null_in_json(path: Path) -> None:
    from typer.testing import CliRunner

    from aatri.cli.main import app

    with h5py.File(path, "r+") as file:
        file.attrs["height"] = np.nan
    told = CliRunner().invoke(app, ["show", str(path), "--json"])
    assert told.exit_code == 0, told.stderr
    assert '"height": null' in told.stdout


@pytest.mark.slow
def test_flipped_bits_end_as_one_kind_of_error(path: Path) -> None:
    whole = path.read_bytes()
    rng = np.random.default_rng(4)
    for _ in range(300):
        data = bytearray(whole)
        for at in rng.integers(0, len(data), 3):
            data[at] ^= 1 << int(rng.integers(8))
        path.write_bytes(data)
        for reader in (hdf5.read_header, lambda p: read(p, Numbers)):
            with contextlib.suppress(ArtifactError):
                reader(path)
