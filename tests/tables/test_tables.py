"""Typed columns to HDF5 and back, also as UTF-8."""

from __future__ import annotations

from dataclasses import FrozenInstanceError, dataclass
from pathlib import Path
from typing import ClassVar

import h5py
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aatri.arrays import Float, Int, Text, is_uniform
from aatri.errors import AatriError, ArtifactError, ResourceError
from aatri.tables.digest import content_digest
from aatri.tables.hdf5 import read, read_header, read_warnings, write
from aatri.tables.schema import Artifact, Table, attribute, column, table
from aatri.tables.utf8 import decoded, encoded, lengths_and_bytes

# Tables and artifacts: declaration, validation, round trip, digest.


class Stations(Table):
    """Stations of a made-up network."""

    id: Text = column("str", doc="id")
    xyz_m: Float = column("f8", 3, unit="m", doc="coordinates", optional=True)
    next: Int = column("i4", doc="row of the next station", refers="stations", optional=True)
    line: Int = column("i4", doc="line in the file", digest=False)


class Network(Artifact):
    """A made-up kind."""

    kind: ClassVar[str] = "Network"

    name: str = attribute(doc="name")
    height_m: float = attribute(unit="m", doc="mean height")
    stations: Stations = table()
    extra: Stations | None = table(default=None)


class Other(Artifact):
    """Another kind."""

    kind: ClassVar[str] = "Other"

    name: str = attribute(doc="name")


def _stations(ids: list[str], xyz: object = None, line: int = 1) -> Stations:
    n = len(ids)
    xyz_m = np.zeros((n, 3)) if xyz is None else np.asarray(xyz)
    return Stations(id=np.array(ids, dtype=np.str_), xyz_m=xyz_m, next=np.full(n, -1), line=np.full(n, line))


def _network(ids: list[str] | None = None, **changes: object) -> Network:
    fields = {"name": "net", "height_m": 6.5, "stations": _stations(["A", "点1"] if ids is None else ids), **changes}
    return Network(**fields)  # type: ignore[arg-type]


def test_an_artifact_comes_back_as_it_was_written(tmp_path: Path) -> None:
    made = _network(stations=_stations(["A", "点1"], [[1.0, 2.0, np.nan], [4e6, -0.0, 1e-300]]))
    digest = write(made, tmp_path / "n.h5")
    back = read(tmp_path / "n.h5", Network)
    assert content_digest(back) == digest == content_digest(made)
    assert back.stations.id.tolist() == ["A", "点1"]
    np.testing.assert_array_equal(back.stations.xyz_m, made.stations.xyz_m)
    assert back.extra is None


@pytest.mark.slow
@settings(max_examples=50, deadline=None)
@given(st.lists(st.text(st.characters(exclude_categories=["Cs", "Cc"]), min_size=1, max_size=20), max_size=5))
def test_any_text_survives(tmp_path_factory: pytest.TempPathFactory, ids: list[str]) -> None:
    path = tmp_path_factory.mktemp("t") / "n.h5"
    write(_network(ids), path)
    assert read(path, Network).stations.id.tolist() == ids


def test_the_file_reads_without_aatri_and_says_its_units(tmp_path: Path) -> None:
    write(_network(), tmp_path / "n.h5")
    with h5py.File(tmp_path / "n.h5") as file:
        assert file.attrs["aatri_kind"].decode() == "Network"
        assert file["stations/xyz_m"].attrs["units"].decode() == "m"
        assert file["stations/xyz_m"].attrs["description"].decode() == "coordinates"
        assert file["stations/next"].attrs["refers"].decode() == "stations"
        assert file["stations/id"].asstr()[:].tolist() == ["A", "点1"]


def test_the_header_is_read_without_the_data(tmp_path: Path) -> None:
    write(_network(), tmp_path / "n.h5")
    header = read_header(tmp_path / "n.h5")
    assert header["kind"] == "Network"
    assert header["attributes"]["height_m"] == 6.5
    assert header["tables"]["stations"]["rows"] == 2


def test_warnings_are_in_the_file_and_no_part_of_the_content(tmp_path: Path) -> None:
    made = _network()
    told = ["image \u70b91 is left out", "odd \udcff name", "sigma0 3.1"]
    assert write(made, tmp_path / "told.h5", told) == write(made, tmp_path / "n.h5")
    assert content_digest(read(tmp_path / "told.h5", Network)) == content_digest(made)
    assert read_warnings(tmp_path / "told.h5") == ("image \u70b91 is left out", "odd \\udcff name", "sigma0 3.1")
    assert read_warnings(tmp_path / "n.h5") == ()
    assert read_header(tmp_path / "told.h5")["tables"]["notes"]["rows"] == 3


def test_provenance_is_no_content_but_everything_else_is() -> None:
    digest = content_digest(_network())
    assert content_digest(_network(stations=_stations(["A", "点1"], line=99))) == digest
    assert content_digest(_network(name="other")) != digest
    assert content_digest(_network(ids=["A", "点2"])) != digest
    assert content_digest(_network(stations=_stations(["A", "点1"], np.eye(2, 3)))) != digest
    assert content_digest(_network(extra=_stations(["A"]))) != digest


def test_the_split_of_texts_matters_to_the_digest() -> None:
    assert content_digest(_network(ids=["ab", "c"])) != content_digest(_network(ids=["a", "bc"]))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"xyz_m": np.zeros((2, 2))}, "shape"),
        ({"xyz_m": np.full((2, 3), np.inf)}, "inf"),
        ({"next": np.array([0, 5])}, "points at row 5"),
        ({"next": np.array([-2, 0])}, "points at row"),
        ({"next": np.array([2**40, 0])}, "too large"),
        ({"next": np.array([0.5, 0.0])}, "not int32"),
        ({"line": np.zeros(3, dtype=np.int32)}, "differ in length"),
    ],
)
def test_what_breaks_the_declaration_is_refused(change: dict, message: str) -> None:
    good = {"id": np.array(["A", "B"]), "xyz_m": np.zeros((2, 3)), "next": np.full(2, -1), "line": np.zeros(2, int)}
    with pytest.raises(ArtifactError, match=message):
        _network(stations=Stations(**{**good, **change}))


def test_columns_cannot_be_written_to() -> None:
    with pytest.raises(ValueError, match="read-only"):
        _network().stations.xyz_m[0, 0] = 1.0


class Readings(Table):
    """Readings, often of one instrument."""

    sigma_m: Float = column("f8", 2, unit="m", doc="standard deviation", optional=True, uniform=True)
    group: Text = column("str", doc="group", uniform=True)


def test_one_value_in_all_rows_of_a_uniform_column_is_in_memory_once() -> None:
    alike = Readings(sigma_m=np.full((200_001, 2), [0.01, np.nan]), group=np.full(200_001, "tacheometer"))
    assert [alike.sigma_m.strides[0], alike.group.strides[0]] == [0, 0]
    np.testing.assert_array_equal(alike.sigma_m, np.full((200_001, 2), [0.01, np.nan]))
    assert set(alike.take([0, 200_000]).group.tolist()) == {"tacheometer"}
    many = np.broadcast_to(np.array([0.01, np.nan]), (10**15, 2))  # row by row it would not end
    assert is_uniform(many)
    differing = np.full((200_001, 2), 0.0)
    differing[-1, 1] = -0.0  # other bits
    one = Readings(sigma_m=differing, group=np.full(200_001, ""))
    assert one.sigma_m.flags.c_contiguous
    assert np.signbit(one.sigma_m).sum() == 1


def test_another_kind_is_refused_by_name(tmp_path: Path) -> None:
    write(_network(), tmp_path / "n.h5")
    with pytest.raises(ArtifactError, match="kind Network, where Other is wanted") as caught:
        read(tmp_path / "n.h5", Other)
    assert caught.value.exit_code == 7


def _break(path: Path, how: str) -> None:
    with h5py.File(path, "r+") as file:
        if how == "unknown column":
            file["stations/colour"] = [1, 2]
        elif how == "missing column":
            del file["stations/xyz_m"]
        elif how == "float32":
            del file["stations/xyz_m"]
            file["stations/xyz_m"] = np.zeros((2, 3), "f4")
        elif how == "external link":
            del file["stations/xyz_m"]
            file["stations/xyz_m"] = h5py.ExternalLink("/etc/passwd", "/x")
        elif how == "soft link":
            del file["stations/xyz_m"]
            file["stations/xyz_m"] = h5py.SoftLink("/stations/next")
        elif how == "external storage":
            del file["stations/xyz_m"]
            file["stations"].create_dataset("xyz_m", (2, 3), "f8", external=[("/etc/hostname", 0, 48)])
        elif how == "unknown table":
            file.create_group("secrets")
        elif how == "version":
            file.attrs["schema_version"] = 99


@pytest.mark.parametrize(
    "how",
    [
        "unknown column",
        "missing column",
        "float32",
        "external link",
        "soft link",
        "external storage",
        "unknown table",
        "version",
    ],
)
def test_foreign_structure_is_refused(tmp_path: Path, how: str) -> None:
    path = tmp_path / "n.h5"
    write(_network(), path)
    _break(path, how)
    with pytest.raises(ArtifactError):
        read(path, Network)


@pytest.mark.parametrize("content", [b"", b"not hdf5", b"\x89HDF\r\n\x1a\n" + b"\0" * 100])
def test_what_is_no_hdf5_is_refused(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "n.h5").write_bytes(content)
    with pytest.raises(ArtifactError):
        read(tmp_path / "n.h5", Network)


def test_a_missing_file_says_so(tmp_path: Path) -> None:
    with pytest.raises(ArtifactError, match="no such artifact"):
        read(tmp_path / "n.h5", Network)


def test_an_existing_file_is_not_overwritten(tmp_path: Path) -> None:
    (tmp_path / "n.h5").write_bytes(b"mine")
    with pytest.raises(ResourceError):
        write(_network(), tmp_path / "n.h5")
    assert (tmp_path / "n.h5").read_bytes() == b"mine"


def test_truncation_is_always_noticed(tmp_path: Path) -> None:
    path = tmp_path / "n.h5"
    write(_network(), path)
    whole = path.read_bytes()
    for share in np.linspace(0.0, 0.99, 25):
        path.write_bytes(whole[: int(share * len(whole))])
        with pytest.raises(AatriError):
            read(path, Network)


def test_tables_are_frozen_dataclasses_by_themselves_and_cannot_be_so_twice() -> None:
    with pytest.raises(FrozenInstanceError):
        _stations(["A"]).id = np.array(["B"])  # type: ignore[misc]
    assert _network() != _network()  # arrays are compared by their digest
    with pytest.raises(TypeError, match="Cannot overwrite attribute __setattr__ in class Stations"):
        dataclass(frozen=True, eq=False)(Stations)
    with pytest.raises(TypeError, match="cannot inherit non-frozen dataclass from a frozen one"):
        dataclass(Stations)


# Columns of text against Python's own encoder, text by text.

TEXTS = {
    "ascii": np.array(["0101", "", "GCP 7", "a,b", "x" * 40]),
    "others": np.array(["Zürich", "", "航空", "a", "\U0001f6e9 plane"]),
    "nul inside": np.array(["a\0b", "c", ""]),
    "nothing": np.array(["", "", ""]),
    "none": np.zeros(0, dtype="U3"),
    "table": np.array([["a", "bc"], ["", "d"]]),
    "strided": np.array(["a", "b", "c", "d"])[::2],
    "big-endian": np.array(["ab", "c"]).astype(">U2"),
}


@pytest.mark.parametrize("texts", TEXTS.values(), ids=TEXTS.keys())
def test_bytes_and_lengths_are_those_of_each_text(texts: np.ndarray) -> None:
    each = [str(text).encode() for text in texts.ravel()]
    assert encoded(texts).ravel().tolist() == each
    length, data = lengths_and_bytes(texts)
    assert length.tolist() == [len(text) for text in each]
    assert data == b"".join(each)
    back = decoded(encoded(texts))
    assert back.shape == texts.shape
    assert back.tolist() == texts.tolist()
