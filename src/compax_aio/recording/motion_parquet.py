"""Motion records as Parquet: the same table, with types, made of the CSV file when the record has ended."""

from __future__ import annotations

import csv
import os
import secrets
from collections.abc import Iterator
from contextlib import suppress
from itertools import islice
from pathlib import Path
from typing import Any, Final

from ..errors import InvalidCommandError
from ..text_file import name_of
from .motion_file import COLUMNS, Row, csv_path_of

try:
    import pyarrow as pa  # type: ignore[import-untyped]
    from pyarrow import parquet
except ModuleNotFoundError as missing:
    raise InvalidCommandError(
        f"Parquet needs {missing.name}, which is not installed",
        hint="pip install 'compax-aio[parquet]', or give the file a name that ends in .csv",
    ) from missing

__all__ = ["convert", "rows_of"]

_ROWS_A_GROUP: Final = 50_000


def _schema() -> Any:
    text = pa.dictionary(pa.int32(), pa.string())
    types = (pa.float64(), text, text, text, pa.float64(), pa.string())
    return pa.schema(list(zip(COLUMNS, types, strict=True)))


def convert(source: Path, target: Path) -> None:
    """
    Make *target* of the CSV file *source*, whole or not at all.

    Raises:
        InvalidCommandError: *source* is no record.
        OSError: One of them cannot be read or written.
    """
    new = target.with_name(f".{target.name[:32]}.{secrets.token_hex(8)}")
    schema = _schema()
    try:
        with source.open(encoding="utf-8", newline="") as file, parquet.ParquetWriter(new, schema) as writer:
            lines = csv.reader(file, strict=True)
            next(lines)
            where = name_of(source)
            while group := [Row.of_fields(fields, where) for fields in islice(lines, _ROWS_A_GROUP)]:
                writer.write_table(_table(group, schema))
        with new.open("rb+") as file:
            os.fsync(file.fileno())  # before anybody removes what it was made of
        new.replace(target)
    except BaseException:
        with suppress(OSError):
            new.unlink()
        raise


def _table(rows: list[Row], schema: Any) -> Any:
    columns = {
        "time_s": [row.time_s for row in rows],
        "axis": [row.axis for row in rows],
        "kind": [row.kind.value for row in rows],
        "name": [row.name for row in rows],
        "value": [row.value for row in rows],
        "text": [row.text for row in rows],
    }
    return pa.table(columns, schema=schema)


def rows_of(path: Path) -> Iterator[Row]:
    """
    Give the rows of a Parquet file.

    Raises:
        InvalidCommandError: It is no motion record.
        OSError: It cannot be read.
    """
    where = name_of(path)
    with path.open("rb") as raw:
        try:
            file = parquet.ParquetFile(raw)
            if tuple(file.schema_arrow.names) != COLUMNS:
                raise InvalidCommandError(f"{where} is no motion record: its columns are not {', '.join(COLUMNS)}")
            number = 0
            for batch in file.iter_batches():
                for fields in zip(*(column.to_pylist() for column in batch.columns), strict=True):
                    number += 1
                    texts = ["" if field is None else str(field) for field in fields]
                    yield Row.of_fields(texts, f"{where}, row {number}")
        except pa.ArrowException as error:
            beside = csv_path_of(path)
            hint = f"what was recorded of it is in {name_of(beside)}" if beside.is_file() else None
            raise InvalidCommandError(f"{where} is no whole Parquet file: {error}", hint=hint) from error
