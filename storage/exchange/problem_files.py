"""Files of problems, read one by one or in slices, with only the current problems in memory."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from storage.errors import StorageError, sentence
from storage.exchange.question_fields import QUESTION_FIELDS
from storage.fields import check_fields, parse_json
from storage.places.files import read_text

if TYPE_CHECKING:
    import pyarrow.parquet as pq

FORMATS: Final = (".json", ".jsonl", ".parquet")
FIELDS: Final = (
    "id", "class", "start", "goal", "goal_radius", "bounds", "obstacles", "groups", "scale", "vehicle",
    *QUESTION_FIELDS,
)  # fmt: skip
MOVING: Final = "moving"  # obstacles that move: there may be none
BATCH_ROWS: Final = 256  # of a Parquet file, turned into Python objects at once
SLICES_A_GROUP: Final = 16  # reading the last rows of a row group also decodes those before
BUFFER_BYTES: Final = 1 << 20


class Unreadable(NamedTuple):
    """Stands for the object in a line that cannot be read; the other lines can."""

    reason: str  # what is wrong with the line


@dataclass(frozen=True)
class ProblemSlice:
    """Some consecutive problems of a file, and where they begin, so that nothing before is read."""

    path: Path
    first: int  # number of the first line or problem, counted from 1
    count: int  # problems
    offset: int  # in a text the first byte; in a Parquet file the first row in the row group
    group: int  # row group; 0 in a text
    digest: str  # of the content of the slice


def format_of(path: Path) -> str:
    """The ending of ``path``, which gives its format. Raises StorageError for any other ending."""
    if path.is_dir():
        raise StorageError(
            f"{path} is a folder; give a file of problems ({', '.join(FORMATS)}), as import-worlds makes "
            "of a folder of worlds."
        )
    if path.suffix not in FORMATS:
        cut = ", or make problems from a map or worlds with import-worlds" if path.exists() else ""
        raise StorageError(
            f"{path} ends in {path.suffix!r}; files of problems end in {', '.join(FORMATS)}. Rename it{cut}."
        )
    return path.suffix


def check_problem_fields(fields: Sequence[object]) -> None:
    """Raise ValueError if a problem has no field of one of these names, or if one occurs twice."""
    check_fields([field for field in fields if field != MOVING], FIELDS)


def raw_problems(path: Path) -> Iterator[tuple[int, Any]]:
    """The objects in the file at ``path`` and their numbers: the line, or counted from 1.

    A line of a text that cannot be read is an ``Unreadable``. Raises StorageError if the file is missing or
    damaged.
    """
    match format_of(path):
        case ".json":
            yield 1, parse_json(read_text(path), str(path))
        case ".jsonl":
            yield from _objects(path)
        case _:
            yield from enumerate(_rows(path), start=1)


def slices_of(path: Path, size: int) -> list[ProblemSlice]:
    """Split the file at ``path`` into slices of ``size`` problems, or more in a long row group.

    Slices and digests depend only on the file's content, so correcting a line does not change the slices
    before it. Raises StorageError if the file is missing or damaged.
    """
    match format_of(path):
        case ".json":
            digest = hashlib.sha256(read_text(path).encode()).hexdigest()
            return [ProblemSlice(path, 1, 1, 0, 0, digest)]
        case ".jsonl":
            return _slices_of_lines(path, size)
        case _:
            return _slices_of_groups(path, size)


def raw_slice(piece: ProblemSlice) -> Iterator[tuple[int, Any]]:
    """The objects of the slice ``piece`` and their numbers, as ``raw_problems`` gives them."""
    match format_of(piece.path):
        case ".json":
            yield from raw_problems(piece.path)
        case ".jsonl":
            yield from islice(_objects(piece.path, piece.offset, piece.first), piece.count)
        case _:
            rows = _rows(piece.path, [piece.group], piece.offset, piece.count)
            yield from enumerate(rows, start=piece.first)


def _objects(path: Path, offset: int = 0, first: int = 1) -> Iterator[tuple[int, Any]]:
    """The objects in the lines of a text from a byte on, where line ``first`` begins."""
    for number, line in enumerate(_lines(path, offset), start=first):
        if not line.strip():
            continue
        try:
            value = parse_json(line, "it")
        except StorageError as error:
            value = Unreadable(str(error).rstrip("."))
        yield number, value


def _lines(path: Path, offset: int = 0) -> Iterator[bytes]:
    try:
        with path.open("rb") as file:
            file.seek(offset)
            yield from file
    except FileNotFoundError:
        raise StorageError(f"{path} does not exist; check the name.") from None
    except OSError as error:
        raise StorageError(f"{path} cannot be read: {error.strerror}.") from None


def _slices_of_lines(path: Path, size: int) -> list[ProblemSlice]:
    slices: list[ProblemSlice] = []
    first, offset, count, end, digest = 1, 0, 0, 0, hashlib.sha256()
    for number, line in enumerate(_lines(path), start=1):
        digest.update(line)
        end += len(line)
        count += bool(line.strip())
        if count == size:
            slices.append(ProblemSlice(path, first, count, offset, 0, digest.hexdigest()))
            first, offset, count, digest = number + 1, end, 0, hashlib.sha256()
    return slices + ([ProblemSlice(path, first, count, offset, 0, digest.hexdigest())] if count else [])


def _slices_of_groups(path: Path, size: int) -> list[ProblemSlice]:
    slices = []
    first = 1
    with _opened(path) as file, path.open("rb") as content:
        for group in range(file.metadata.num_row_groups):
            described = file.metadata.row_group(group)
            columns = [described.column(i) for i in range(described.num_columns)]
            begin = min(
                (column.dictionary_page_offset or column.data_page_offset for column in columns), default=0
            )
            digest = _digest(content, begin, sum(column.total_compressed_size for column in columns))
            rows = described.num_rows
            step = max(size, -(-rows // SLICES_A_GROUP))
            slices += [
                ProblemSlice(path, first + row, min(step, rows - row), row, group, digest)
                for row in range(0, rows, step)
            ]
            first += rows
    return slices


def _digest(content: Any, begin: int, size: int) -> str:
    digest = hashlib.sha256()
    content.seek(begin)
    while size > 0 and (read := content.read(min(size, BUFFER_BYTES))):
        digest.update(read)
        size -= len(read)
    return digest.hexdigest()


def _rows(
    path: Path, groups: list[int] | None = None, first: int = 0, count: int | None = None
) -> Iterator[Any]:
    """The rows of all row groups, or ``count`` rows from row ``first`` of some."""
    last = None if count is None else first + count
    with _opened(path) as file:
        at = 0
        for batch in file.iter_batches(BATCH_ROWS, row_groups=groups):
            begin, end = max(first - at, 0), len(batch) if last is None else min(last - at, len(batch))
            if begin < end:
                yield from batch.slice(begin, end - begin).to_pylist()
            at += len(batch)
            if last is not None and at >= last:
                break


@contextmanager
def _opened(path: Path) -> Iterator[pq.ParquetFile]:
    import pyarrow as pa  # late: a robot may not have pyarrow
    import pyarrow.parquet as pq

    try:
        with pq.ParquetFile(path, buffer_size=BUFFER_BYTES) as file:
            check_problem_fields(file.schema_arrow.names)
            yield file
    except FileNotFoundError:
        raise StorageError(f"{path} does not exist; check the name.") from None
    except (pa.ArrowException, OSError) as error:
        reason = str(error).partition("\n")[0].rstrip(".")
        raise StorageError(f"{path} is not a complete Parquet file ({reason}); write it again.") from None
    except ValueError as error:
        raise StorageError(sentence(path, error)) from None
