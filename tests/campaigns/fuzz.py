"""Change good inputs of a reader at random: it reads them, or says what is wrong, and neither takes long nor much.

    python -m tests.campaigns.fuzz READER|all|programs --count 20000 [--seed S]

Every input is a good one (`fuzz_seeds`) with up to six changes: bytes flipped, put in, cut out, doubled; words replaced
by numbers too large, too small, not finite, not ASCII, by quotes, zero bytes, control characters, the words of other
places; lines doubled, swapped, glued; texts of 40,000 characters; HDF5 files also by changes of what they hold
(`hdf5_changes`). One input in four has one number written anew, and must be read as that number or refused
(`fuzz_numbers`). Afterwards the reader must have given a result or an
error of aatri's own, of the kind that its input can have (exit code 2, 3, 4 or 9 for what a user writes, 7 for files of
a run), each in at most 2 s of processor time and 500 MB of memory more than before. What is not so is printed and, with
`--keep DIR`, kept.
"""

from __future__ import annotations

import argparse
import contextlib
import random
import re
import resource
import shutil
import signal
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from pathlib import Path

from aatri.errors import AatriError, Errors
from tests.campaigns.fuzz_numbers import Numbers
from tests.campaigns.fuzz_programs import OF_OTHER_PROGRAMS
from tests.campaigns.fuzz_seeds import OF_BLOCKS, READERS, Reader

EVERY = READERS | OF_OTHER_PROGRAMS
"""All readers by name."""
MOST_SECONDS, MOST_BYTES = 2.0, 500_000_000
HANGS_S = 60
PROGRESS = 2000
"""A line of progress after so many inputs."""
OF_NUMBERS = 0.25
"""Share of the inputs of a reader of blocks that have one number written anew."""
IN_MEMORY = "/dev/shm" if Path("/dev/shm").is_dir() else None
"""Where inputs are written: on a disk their writing takes longer than their reading."""
WORDS = (
    b"1e308",
    b"-1e308",
    b"1e-320",
    b"1e999",
    b"nan",
    b"-inf",
    b".inf",
    b"NaN",
    b"-0",
    b"0",
    b"-1",
    b"1.0",
    b"1e2",
    b"9223372036854775808",
    b"18446744073709551616",
    b"4611686018427387904",
    b"2147483648",
    b"1_000",
    b"0x1F",
    b"12,5",
    b"1.2.3",
    b"9" * 400,
    b"7" * 40_000,
    b"x" * 40_000,
    b"1e" + b"9" * 300,
    b"",
    b'"',
    b'""',
    b"'",
    b"#",
    b"\0",
    b"\t",
    b"\r",
    b"\n",
    b"\x1b[2J",
    b"\xff\xfe",
    b"\xe2\x88\x925",
    "１２".encode(),
    "点号".encode("gb18030"),
    b"\xc2\x9b31m",
    b"\xed\xa0\x80",
    b"../../etc/passwd",
    b"/etc/passwd",
    b"=1+1",
    b"null",
    b"true",
    b"~",
    b"{}",
    b"[]",
    b"{a: 1}",
    b"[1, 2]",
    b"!!python/object:os.system",
    b"&a",
    b"*a",
    b"<<",
    b"---",
    b": ",
    b"- ",
    b"a" * 300,
    b"12-99-1",
    b"yes",
    b"control",
    b"XY:control Z:check",
    b"observed",
    b"distance",
    b"direction",
    b"pixel",
    b"film",
    b"[[[[[[[[",
)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("reader", choices=[*EVERY, "all", "programs"])
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--keep", type=Path, help="folder that keeps the inputs that went wrong")
    given = parser.parse_args()
    wrong = 0
    several = {"all": EVERY, "programs": OF_OTHER_PROGRAMS}
    for name in several.get(given.reader, [given.reader]):
        wrong += campaign(name, given.count, given.seed, given.keep)
    sys.exit(1 if wrong else 0)


def campaign(name: str, count: int, seed: int, keep: Path | None = None) -> int:
    """Try a reader on so many inputs; how many of them went wrong."""
    reader, counted, begin = EVERY[name], Counter[str](), time.monotonic()
    slowest, largest, wrong = 0.0, 0, 0
    with tempfile.TemporaryDirectory(prefix="fuzz-", dir=IN_MEMORY) as place, _quiet():
        folder = Path(place) / "input"
        folder.mkdir()
        reader.write(folder)
        reader.read(folder)  # a good input is read, and all is imported
        good = {file: (folder / file).read_bytes() for file in reader.files}
        numbers = Numbers(reader, folder, good) if name in (*OF_BLOCKS, *OF_OTHER_PROGRAMS) else None
        for number in range(count):
            chance = random.Random(f"{name}:{seed}:{number}")
            file = chance.choice(reader.files)
            memory, clock = _memory_now(), time.process_time()
            if numbers is not None and chance.random() < OF_NUMBERS:
                outcome, complaint = "with one number written anew", numbers.wrong(chance)
            else:
                (folder / file).write_bytes(_input(good[file], reader, chance))
                memory, clock = _memory_now(), time.process_time()
                outcome, complaint = _tried(reader, folder)
            seconds, grown = time.process_time() - clock, _most_memory() - memory
            if seconds > MOST_SECONDS and not complaint:
                complaint = f"{seconds:.1f} s"
            if grown - largest > 0 and grown > MOST_BYTES and not complaint:
                complaint = f"{grown / 1e6:.0f} MB"
            slowest, largest = max(slowest, seconds), max(largest, grown)
            counted[outcome] += 1
            if complaint:
                wrong += 1
                sys.stderr.write(f"{name} {number}, {file}: {complaint}\n")
                if keep:
                    shutil.copytree(folder, keep / f"{name}-{number}", dirs_exist_ok=True)
            (folder / file).write_bytes(good[file])
            if (number + 1) % PROGRESS == 0:
                sys.stderr.write(f"{name}: {number + 1} of {count} inputs, {time.monotonic() - begin:.0f} s\n")
    figures = ", ".join(f"{n} {outcome}" for outcome, n in sorted(counted.items()))
    sys.stdout.write(
        f"fuzz {name}: {count} inputs: {figures}; slowest {slowest:.2f} s, at most {largest / 1e6:.0f} "
        f"MB; {time.monotonic() - begin:.0f} s" + (f"; WRONG {wrong}" if wrong else "") + "\n"
    )
    return wrong


def _input(good: bytes, reader: Reader, chance: random.Random) -> bytes:
    if reader.other is None or chance.random() < 0.5:
        return changed(good, chance, binary=reader.binary)
    data = reader.other(good, chance)
    return changed(data, chance, binary=reader.binary) if chance.random() < 0.1 else data


def changed(data: bytes, chance: random.Random, *, binary: bool) -> bytes:
    """The data with one to six changes."""
    for _ in range(chance.choice((1, 1, 1, 2, 3, 6))):
        ways = (_bytes,) if binary and chance.random() < 0.8 else (_bytes, _words, _words, _words, _lines)
        data = chance.choice(ways)(data, chance)
    return data


def _bytes(data: bytes, chance: random.Random) -> bytes:
    if not data:
        return chance.randbytes(20)
    at, length = chance.randrange(len(data)), chance.choice((1, 1, 2, 4, 8, 8, 60))
    way = chance.randrange(6)
    if way == 0:
        return data[:at] + bytes([data[at] ^ 1 << chance.randrange(8)]) + data[at + 1 :]
    if way == 1:
        return data[:at] + chance.randbytes(length) + data[at + length :]
    if way == 2:
        return data[:at] + chance.choice((b"\xff", b"\0", b"\x7f", b"\x40")) * length + data[at + length :]
    if way == 3:
        return data[:at] + data[at + length :]
    if way == 4:
        return data[:at] + data[at : at + length] * 2 + data[at + length :]
    return data[:at]


def _words(data: bytes, chance: random.Random) -> bytes:
    """Put a nasty word, or one from elsewhere, in the place of a word."""
    edges = [-1, *(found.start() for found in re.finditer(rb"[ ,\n\t:{}\[\]]", data)), len(data)]
    k = chance.randrange(len(edges) - 1)
    other = chance.randrange(len(edges) - 1)
    elsewhere = data[edges[other] + 1 : edges[other + 1]]
    word = chance.choice(WORDS) if chance.random() < 0.7 else elsewhere
    return data[: edges[k] + 1] + word + data[edges[k + 1] :]


def _lines(data: bytes, chance: random.Random) -> bytes:
    lines = data.split(b"\n")
    a, b = chance.randrange(len(lines)), chance.randrange(len(lines))
    way = chance.randrange(6)
    if way == 0:
        lines[a], lines[b] = lines[b], lines[a]
    elif way == 1:
        del lines[a]
    elif way == 2:
        lines[a:a] = [lines[b]] * chance.choice((1, 2, 2000))
    elif way == 3:
        lines[a] = lines[a] + lines[b]
    elif way == 4:
        lines[a] = lines[a] + chance.choice((b",", b" 1", b",,,", b'"', b"\\", b" #", b"\r")) * chance.choice((1, 3))
    else:
        del lines[a:]
    return b"\n".join(lines)


def _tried(reader: Reader, folder: Path) -> tuple[str, str]:
    """What came of reading, and what is wrong with that."""
    signal.signal(signal.SIGALRM, _too_long)
    signal.alarm(HANGS_S)
    try:
        reader.read(folder)
    except AatriError as error:
        single = error.errors if isinstance(error, Errors) else (error,)
        ours = 7 if folder_of_run(reader) else None
        for one in single:
            if one.exit_code not in ((7,) if ours else (2, 3, 4, 9)):
                return "refused", f"exit code {one.exit_code}: {str(one)[:300]}"
            if len(str(one)) > 20_000:
                return "refused", f"a message of {len(str(one))} characters"
        return "refused", ""
    except BaseException as error:
        if isinstance(error, KeyboardInterrupt):
            raise
        where = traceback.extract_tb(error.__traceback__)
        ours_last = [
            f"{Path(f.filename).name}:{f.lineno}" for f in where if "aatri" in f.filename or "stages" in f.filename
        ]
        return "internal errors", f"{type(error).__name__}: {str(error)[:200]} at {' '.join(ours_last[-3:])}"
    finally:
        signal.alarm(0)
    return "read", ""


def folder_of_run(reader: Reader) -> bool:
    """Whether its input is a file of a run, and not one of a user."""
    return reader in (READERS["records"], READERS["hdf5"], READERS["hdf5_block"])


def _too_long(*_: object) -> None:
    raise TimeoutError(f"more than {HANGS_S} s")


def _memory_now() -> int:
    """Bytes in memory; the peak begins anew, for the making of an input may have taken more than its reading will."""
    with contextlib.suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5")
    return _most_memory()


def _most_memory() -> int:
    """Peak of the bytes in memory."""
    with contextlib.suppress(OSError):
        status = Path("/proc/self/status").read_text()
        return 1024 * int(status.split("VmHWM:")[1].split()[0])
    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


@contextlib.contextmanager
def _quiet():  # type: ignore[no-untyped-def]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield


if __name__ == "__main__":
    main()
