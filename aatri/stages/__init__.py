"""The built-in stages. In a checkout they are the folder `stages/` at the top; in a wheel they lie here."""

from pathlib import Path

if not (Path(__file__).parent / "block").is_dir():
    __path__ = [str(Path(__file__).resolve().parents[2] / "stages")]
