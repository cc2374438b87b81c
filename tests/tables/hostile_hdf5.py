"""HDF5 files made to harm, each a small change of a good artifact."""

from __future__ import annotations

from collections.abc import Callable

import h5py
import numpy as np

Change = Callable[[h5py.File, str], None]
"""Changes a file; the text is the path of a column in it, `TABLE/COLUMN`."""


def _without(file: h5py.File, column: str) -> h5py.Group:
    del file[column]
    return file[column.split("/")[0]]


def external_link(file: h5py.File, column: str) -> None:
    del file[column]
    file[column] = h5py.ExternalLink("secret.h5", "/secret")


def external_table(file: h5py.File, column: str) -> None:
    file["more"] = h5py.ExternalLink("secret.h5", "/")


def soft_link(file: h5py.File, column: str) -> None:
    del file[column]
    file[column] = h5py.SoftLink("/nowhere")


def second_name(file: h5py.File, column: str) -> None:
    file[column + "_again"] = file[column]


def circle(file: h5py.File, column: str) -> None:
    file[column.split("/")[0] + "/inner"] = file["/"]


def external_storage(file: h5py.File, column: str) -> None:
    _without(file, column).create_dataset(column.split("/")[1], (8,), "i1", external=[("secret.h5", 0, 8)])


def virtual(file: h5py.File, column: str) -> None:
    layout = h5py.VirtualLayout((8,), "f8")
    layout[:] = h5py.VirtualSource("secret.h5", "secret", (8,))
    _without(file, column).create_virtual_dataset(column.split("/")[1], layout)


def terabytes(file: h5py.File, column: str) -> None:
    _without(file, column).create_dataset(column.split("/")[1], (10**12,), "f8", chunks=(1024,))


def giant_chunk(file: h5py.File, column: str) -> None:
    _without(file, column).create_dataset(column.split("/")[1], (2,), "f8", chunks=(2**28,), maxshape=(None,))


def bomb(file: h5py.File, column: str) -> None:
    made = _without(file, column).create_dataset(
        column.split("/")[1], data=np.zeros(1 << 25, "i1"), chunks=(1 << 25,), compression="gzip"
    )
    assert made.id.get_storage_size() < 50_000


def deflated_twice(file: h5py.File, column: str) -> None:
    creation = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    creation.set_chunk((8,))
    creation.set_deflate(1)
    creation.set_deflate(1)
    group = _without(file, column)
    space, name = h5py.h5s.create_simple((8,)), column.split("/")[1].encode()
    h5py.h5d.create(group.id, name, h5py.h5t.NATIVE_DOUBLE, space, creation)


def foreign_filter(file: h5py.File, column: str) -> None:
    creation = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    creation.set_chunk((8,))
    creation.set_filter(32008, h5py.h5z.FLAG_OPTIONAL, (0,))
    group = _without(file, column)
    space, name = h5py.h5s.create_simple((8,)), column.split("/")[1].encode()
    h5py.h5d.create(group.id, name, h5py.h5t.NATIVE_DOUBLE, space, creation)


def texts_of_any_length(file: h5py.File, column: str) -> None:
    group, name = _without(file, column), column.split("/")[1]
    group.create_dataset(name, data=["a", "b"], dtype=h5py.string_dtype())


def references(file: h5py.File, column: str) -> None:
    group, name = _without(file, column), column.split("/")[1]
    group.create_dataset(name, (2,), dtype=h5py.ref_dtype)


def compound(file: h5py.File, column: str) -> None:
    group, name = _without(file, column), column.split("/")[1]
    group.create_dataset(name, (2,), dtype=np.dtype([("a", "f8"), ("b", "i4")]))


def lists(file: h5py.File, column: str) -> None:
    group, name = _without(file, column), column.split("/")[1]
    group.create_dataset(name, (2,), dtype=h5py.vlen_dtype(np.float64))


def scalar(file: h5py.File, column: str) -> None:
    _without(file, column)[column.split("/")[1]] = 3.5


def null(file: h5py.File, column: str) -> None:
    _without(file, column)[column.split("/")[1]] = h5py.Empty("f8")


def dataset_at_the_top(file: h5py.File, column: str) -> None:
    file["column"] = np.zeros(3)


def group_as_column(file: h5py.File, column: str) -> None:
    del file[column]
    file.create_group(column)


def named_type(file: h5py.File, column: str) -> None:
    file[column + "_type"] = np.dtype("f8")


def list_as_attribute(file: h5py.File, column: str) -> None:
    file[column].attrs["units"] = ["m", "mm"]


def text_of_any_length(file: h5py.File, column: str) -> None:
    """Lies in a heap without a checksum: a wrong byte there has the library read for ever."""
    file[column].attrs["units"] = "m"


def long_text(file: h5py.File, column: str) -> None:
    file[column].attrs["units"] = np.array(b"m", dtype="S65537")


def number_as_kind(file: h5py.File, column: str) -> None:
    file.attrs["aatri_kind"] = 3.5


def text_as_version(file: h5py.File, column: str) -> None:
    file.attrs["schema_version"] = np.array(b"one", dtype="S3")


CHANGES: dict[str, Change] = {
    change.__name__: change
    for change in (
        external_link,
        external_table,
        soft_link,
        second_name,
        circle,
        external_storage,
        virtual,
        terabytes,
        giant_chunk,
        bomb,
        deflated_twice,
        foreign_filter,
        texts_of_any_length,
        references,
        compound,
        lists,
        scalar,
        null,
        dataset_at_the_top,
        group_as_column,
        named_type,
        list_as_attribute,
        text_of_any_length,
        long_text,
        number_as_kind,
        text_as_version,
    )
}
NOT_OF_THE_HEADER = {"number_as_kind", "text_as_version"}
"""What `show` can tell, and only a stage cannot use."""
