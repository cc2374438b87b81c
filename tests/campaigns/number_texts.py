"""Texts that mean a number and texts that mean none, for the fuzz campaign."""

from __future__ import annotations

import re
from fractions import Fraction

STEP = 1e-4
"""Change of a number that tells what it does, of its size."""


def meaning(text: str, grammar: str = "") -> float | None:
    """The number a text means, None if none: `[+-] digits [. digits] [e [+-] digits]`, digits 0 to 9.

    YAML and JSON have no numbers with a leading zero, and JSON none with a plus or without a digit beside the point
    (RFC 8259).
    """
    if grammar == ".json" and not re.fullmatch(r"-?[0-9]+(\.[0-9]+)?([eE].*)?", text, re.DOTALL):
        return None
    sign, body = (text[:1], text[1:]) if text[:1] in ("+", "-") else ("", text)
    mantissa, e, power = body.replace("E", "e").partition("e")
    whole, _, part = mantissa.partition(".")
    exponent = power[1:] if power[:1] in ("+", "-") else power
    digits = set("0123456789")
    if not whole + part or set(whole + part) - digits or (e and (not exponent or set(exponent) - digits)):
        return None
    if len(text) > 300 or (grammar and len(whole) > 1 and whole[0] == "0") or len(exponent.lstrip("0")) > 3:
        return None
    number = Fraction(int(whole or "0")) + Fraction(int(part or "0"), 10 ** len(part))
    number *= Fraction(10) ** (int(power) if e else 0)
    if number > 10**100:
        return None
    return float(-number if sign == "-" else number)


def _signed(old: str) -> str:
    return old if old[0] in "+-" else f"+{old}"


def _longer(old: str) -> str:
    return old + ("000" if "." in old and "e" not in old.lower() else "")


def _scientific(old: str) -> str:
    number = Fraction(old)
    return f"{float(number / 10)!r}E+01" if float(number / 10) * 10 == float(number) else old


def _shifted(old: str) -> str:
    return old if "e" in old.lower() else f"{old}e0"


def _another(old: str) -> str:
    return repr(float(old) * (1 + 3 * STEP))


def _one_digit_more(old: str) -> str:
    return old if "e" in old.lower() else old + ("7" if "." in old else ".00007")


def _with(sign: str, at: int = -1):  # type: ignore[no-untyped-def]
    return lambda old: old[:at] + sign + old[at:] if len(old) > 1 else f"{old}{sign}{old}"


def _digits(zero: str):  # type: ignore[no-untyped-def]
    return lambda old: "".join(chr(ord(zero) + int(c)) if c in "0123456789" else c for c in old)


RIGHT = (_signed, _longer, _scientific, _shifted)
"""The same number in other words."""
NEW = (_another, _one_digit_more)
"""Another number."""
WRONG = (
    _with("_"),
    _with(","),
    _with("'"),
    _with("\u00a0"),
    _with("\u2009"),
    _with(" "),
    _with(".."),
    _with("x"),
    _digits("\u0660"),
    _digits("\uff10"),
    _digits("\u09e6"),
    lambda old: old.replace(".", ",") if "." in old else f"{old},5",
    lambda old: f"{old}-",
    lambda old: f"--{old}",
    lambda old: f"+-{old}",
    lambda old: f"\u2212{old.lstrip('+-')}",
    lambda old: f"{old}e",
    lambda old: f"{old}e999",
    lambda old: f"{old}d1",
    lambda old: f"{old}m",
    lambda old: f"{old}%",
    lambda old: f"({old})",
    lambda old: f"{old}/2",
    lambda old: f"{old}f",
    lambda old: f"{old}j",
    lambda old: f"{old}\u00b2",
    lambda old: f"{old}\u00b0",
    lambda _: "nan",
    lambda _: "inf",
    lambda _: "-Infinity",
    lambda _: "0x1F",
    lambda _: "1#QNAN",
    lambda _: "***",
    lambda _: ".",
    lambda _: "-",
    lambda _: "1e5.5",
    lambda _: "True",
    lambda _: "None",
    lambda _: "1:30",
)
"""Texts that mean no number."""
