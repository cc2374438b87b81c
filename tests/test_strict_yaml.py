from __future__ import annotations

import math
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aatri.errors import InputError, SpecError
from aatri.strict_yaml import Document, load, loads


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1e-6", 1e-6),
        ("1E5", 1e5),
        (".5", 0.5),
        ("1.", 1.0),
        ("-0.25", -0.25),
        ("0", 0),
        ("-7", -7),
        ("+3", 3),
        ("0123", "0123"),
        ("007.5", "007.5"),
        ("0x1F", "0x1F"),
        ("1_000", "1_000"),
        ("12:30:00", "12:30:00"),
        ("on", "on"),
        ("no", "no"),
        ("NO", "NO"),
        ("y", "y"),
        ("true", True),
        ("FALSE", False),
        ("null", None),
        ("~", None),
        ("", None),
        ("'1'", "1"),
        ('"null"', "null"),
        (".inf", math.inf),
        ("-.inf", -math.inf),
        ("2024-01-02", "2024-01-02"),
        ("１２", "１２"),
        ("{block}", {"block": None}),
        ("[]", []),
        ("=", "="),
        ("{<<: 1}", {"<<": 1}),
    ],
)
def test_scalars_follow_the_core_schema_with_leading_zeros_as_text(text: str, value: object) -> None:
    assert loads(text).value == value
    assert type(loads(text).value) is type(value)


def test_nan_is_a_float() -> None:
    assert math.isnan(loads(".nan").value)


def test_keys_are_text_as_written() -> None:
    assert loads("1: a\n0123: b\ntrue: c\n1.50: d").value == {"1": "a", "0123": "b", "true": "c", "1.50": "d"}


def test_places_count_from_one() -> None:
    doc = loads("stages:\n  models: {use: x, with: {tol: 1e-6}}\nlist:\n- a\n- [b, 012]\n", "p.yaml")
    assert doc.where("stages", "models", "with", "tol") == "p.yaml:2:32"
    assert doc.where_key("stages", "models", "with") == "p.yaml:2:20"
    assert doc.where("list", 1, 1) == "p.yaml:5:7"
    assert doc.where("stages", "nowhere", "else") == "p.yaml:2:3"
    assert doc.where() == "p.yaml:1:1"


def test_text_gives_ids_as_written() -> None:
    doc = loads('points: [A, 0012, 12, "11", 1.50]')
    assert [doc.text("points", k) for k in range(5)] == ["A", "0012", "12", "11", "1.50"]
    with pytest.raises(SpecError, match="not a single value"):
        doc.text("points")


@pytest.mark.parametrize(
    ("text", "place", "message"),
    [
        ("a: 1\nb: 2\na: 3\n", "p.yaml:3:1", "given twice, first in line 1"),
        ("a: &x 1\n", "p.yaml:1:4", "anchors"),
        ("a: *x\n", "p.yaml:1:4", "anchors"),
        ("a: !!python/object/apply:os.system [ls]\n", "p.yaml:1:4", "tags"),
        ("a: !!str 1\n", "p.yaml:1:4", "tags"),
        ("a:\n\tb: 1\n", "p.yaml:2:1", "a tab"),
        ("a: [1, 2\nb: 3\n", "p.yaml:2:2", "not YAML"),
        ("a: 1\n---\nb: 2\n", "p.yaml:2:1", "second document"),
        ("? [1, 2]\n: 3\n", "p.yaml:1:3", "single name"),
        ("a: 1e400\n", "p.yaml:1:4", "too large"),
        ("a: " + "9" * 5000, "p.yaml:1:4", "digits"),
        ("[" * 40 + "]" * 40, "p.yaml:1:33", "deeper than 32"),
        ("a: `x`\n", "p.yaml:1:4", "may not begin"),
        ("a: 1\nb: \x00\n", "p.yaml:2:", "does not allow|not YAML"),
    ],
)
def test_traps_are_refused_with_their_place(text: str, place: str, message: str) -> None:
    with pytest.raises(SpecError, match=message) as caught:
        loads(text, "p.yaml")
    assert caught.value.where.startswith(place)


def test_a_file_beyond_the_limit_is_refused_and_not_cut_off(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "p.yaml"
    path.write_text("a: 1\nb: 2\n")
    for limit, refused in ((10, False), (9, True)):
        monkeypatch.setattr("aatri.strict_yaml.MAX_BYTES", limit)
        if refused:
            with pytest.raises(SpecError, match="larger than 9 bytes"):
                load(path)
        else:
            assert load(path).value == {"a": 1, "b": 2}


def test_deep_and_large_input_is_refused_at_once() -> None:
    with pytest.raises(SpecError, match="deeper"):
        loads("[" * 500_000)
    with pytest.raises(SpecError, match="larger"):
        loads("a" * (2 << 20))


def test_a_missing_file_names_the_nearest(tmp_path: Path) -> None:
    (tmp_path / "pipeline.yaml").write_text("a: 1\n")
    with pytest.raises(InputError, match=r"did you mean 'pipeline.yaml'") as caught:
        load(tmp_path / "pipelin.yaml", InputError)
    assert caught.value.exit_code == 3
    with pytest.raises(SpecError, match="folder"):
        load(tmp_path)
    with pytest.raises(SpecError, match="no folder"):
        load(tmp_path / "gone" / "a.yaml")


def test_files_may_have_a_byte_order_mark_but_must_be_utf8(tmp_path: Path) -> None:
    path = tmp_path / "a.yaml"
    path.write_bytes(b"\xef\xbb\xbfa: 1\n")
    assert load(path).value == {"a": 1}
    path.write_bytes("a: 1\nname: 点\n".encode("gb18030"))
    with pytest.raises(SpecError, match="not UTF-8") as caught:
        load(path)
    assert caught.value.where == f"{path}:2:1"


_PIECES = st.sampled_from(
    [
        "a",
        "b: ",
        "- ",
        "[",
        "]",
        "{",
        "}",
        ", ",
        ": ",
        "\n",
        "  ",
        "\t",
        "'",
        '"',
        "&x",
        "*x",
        "!t ",
        "1e9",
        "0",
        "\0",
        "#",
        "|\n",
        ">",
        "---",
        "%",
        "?",
        "\ud800",
        "\x85",
    ]
)


@pytest.mark.slow
@settings(max_examples=400, deadline=None)
@given(st.one_of(st.lists(_PIECES, max_size=25).map("".join), st.text(max_size=60)))
def test_whatever_the_text_only_the_given_error_comes_out(text: str) -> None:
    try:
        doc = loads(text, "fuzz", InputError)
    except InputError:
        return
    assert isinstance(doc, Document)


@settings(max_examples=100, deadline=None)
@given(st.binary(max_size=80))
def test_whatever_the_bytes_only_the_given_error_comes_out(
    tmp_path_factory: pytest.TempPathFactory, data: bytes
) -> None:
    path = tmp_path_factory.mktemp("fuzz") / "a.yaml"
    path.write_bytes(data)
    try:
        load(path, InputError)
    except InputError:
        return
