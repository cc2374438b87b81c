"""Changes of the structure and the values of an HDF5 file, made in memory, for the fuzz campaign.

Bytes changed at random mostly end at a checksum. These files are whole, by HDF5's own library, and wrong in what they
say: columns that are missing, cut, of another type or shape, with numbers and texts that have no place there,
attributes of other values, and the hostile ones of tests/tables/hostile_hdf5.py.
"""

from __future__ import annotations

import io
import random

import h5py
import numpy as np

from tests.tables.hostile_hdf5 import CHANGES

HOSTILE = [change for name, change in CHANGES.items() if name != "bomb"]  # a bomb takes long to make
NUMBERS = (-1, 0, 1, 2**31 - 1, -(2**31), 2**63 - 1, -(2**63), np.nan, np.inf, -np.inf, 1e308, 1e-320, -0.0, 1e100)
TEXTS = (
    b"",
    b"\xff\xfe",
    b"\xed\xa0\x80",
    b"\x1b[2J",
    b"=1+1",
    b"a" * 300,
    b"../x",
    b"\x00x",
    "\u202e".encode(),
    b"nan",
)
LARGEST = 1_000_000
VALUES = (*NUMBERS, "", "x" * 40_000, "Block", "\ud7ff", True, b"\xff")


def changed_file(data: bytes, chance: random.Random) -> bytes:
    """The file with one to three changes; those that HDF5 itself does not take are left out."""
    image = io.BytesIO(data)
    with h5py.File(image, "r+") as file:
        for _ in range(chance.choice((1, 1, 2, 3))):
            tables = [name for name in file if file.get(name, getlink=True).__class__ is h5py.HardLink]
            columns = [f"{t}/{c}" for t in tables if isinstance(file[t], h5py.Group) for c in file[t]]
            if columns:
                _change(file, chance.choice(columns), chance)
    return image.getvalue()


def _change(file: h5py.File, column: str, chance: random.Random) -> None:
    try:
        found = file.get(column)
        if isinstance(found, h5py.Dataset) and (found.size or 0) > LARGEST:
            return  # an earlier change declares terabytes
        chance.choice((_values, _values, _values, _shape, _type, _attribute, _structure, _hostile))(
            file, column, chance
        )
    except (TypeError, ValueError, OSError, LookupError, RuntimeError, AttributeError, OverflowError):
        return


def _values(file: h5py.File, column: str, chance: random.Random) -> None:
    """Put a number or text into one row, or all."""
    data = file[column][()]
    if not data.size:
        return
    with np.errstate(all="ignore"):
        value = np.array(chance.choice(TEXTS if data.dtype.kind == "S" else NUMBERS)).astype(data.dtype)
    if chance.random() < 0.3:
        data[:] = value
    else:
        data.flat[chance.randrange(data.size)] = (
            value if chance.random() < 0.7 else data.flat[chance.randrange(data.size)]
        )
    file[column][...] = data


def _shape(file: h5py.File, column: str, chance: random.Random) -> None:
    data = file[column][()]
    shapes = (data[:-1], data[:0], np.concatenate([data, data]), data[..., None], data.ravel(), data[::-1])
    _replaced(file, column, shapes[chance.randrange(len(shapes))])


def _type(file: h5py.File, column: str, chance: random.Random) -> None:
    data = file[column][()]
    with np.errstate(all="ignore"):
        _replaced(file, column, data.astype(chance.choice(("f8", "f4", "i8", "u1", "i1", "bool", "S3", ">f8", ">i4"))))


def _replaced(file: h5py.File, column: str, data: np.ndarray) -> None:
    kept = dict(file[column].attrs)
    del file[column]
    file[column] = data
    file[column].attrs.update(kept)


def _attribute(file: h5py.File, column: str, chance: random.Random) -> None:
    owner = chance.choice((file, file, file[column], file[column.split("/")[0]]))
    names = [*owner.attrs, "more"]
    if chance.random() < 0.2:
        del owner.attrs[chance.choice(names[:-1])]
    else:
        value = chance.choice(VALUES)
        if isinstance(value, str) and chance.random() < 0.9:  # texts of any length are refused as such
            value = np.array(value.encode("utf-8", "surrogatepass") or b"\0")
        owner.attrs[chance.choice(names)] = value


def _structure(file: h5py.File, column: str, chance: random.Random) -> None:
    table = column.split("/")[0]
    way = chance.randrange(5)
    if way == 0:
        del file[column]
    elif way == 1:
        del file[table]
    elif way == 2:
        file.move(column, f"{table}/{chance.choice(('x', 'id', 'y' * 300, '点'))}")
    elif way == 3:
        file.move(table, chance.choice(("x", "notes", "Images", "\x1b[2J")))
    else:
        file.copy(column, f"{table}/another")


def _hostile(file: h5py.File, column: str, chance: random.Random) -> None:
    chance.choice(HOSTILE)(file, column)
