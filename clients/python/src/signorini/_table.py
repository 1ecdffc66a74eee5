"""Tables: columns by name, as arrays; what those of sweeps and of jobs have in common, and the table of jobs."""

from __future__ import annotations

import difflib
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ._data import Array
from ._extras import load

if TYPE_CHECKING:
    import pandas
    import pyarrow

SHOWN_ROWS = 10
"""Rows of a table that its `repr` shows."""


class Table:
    """Columns of equal length.

    columns: arrays by name
    """

    def __init__(self, columns: Mapping[str, Array]) -> None:
        self.columns: dict[str, Array] = dict(columns)

    def __getitem__(self, name: str) -> Array:
        """A column. Raises KeyError with the names that there are."""
        if name not in self.columns:
            close = difflib.get_close_matches(name, self.columns, 1)
            guess = f"did you mean {close[0]!r}? " if close else ""
            raise KeyError(f"there is no column {name!r}; {guess}there are {', '.join(self.columns)}")
        return self.columns[name]

    def __contains__(self, name: object) -> bool:
        return name in self.columns

    def __iter__(self) -> Iterator[str]:
        """The names of the columns."""
        return iter(self.columns)

    def __len__(self) -> int:
        """The number of rows."""
        return next((len(column) for column in self.columns.values()), 0)

    def __repr__(self) -> str:
        return "\n".join(self._lines(list(self)))

    def _lines(self, names: Sequence[str]) -> list[str]:
        """The first rows of these columns, as text."""
        rows = [list(names)] + [
            [_cell(self.columns[name][row]) for name in names] for row in range(min(len(self), SHOWN_ROWS))
        ]
        widths = [max(len(row[column]) for row in rows) for column in range(len(names))]
        lines = ["  ".join(cell.rjust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]
        if len(self) > SHOWN_ROWS:
            lines.append(f"… {len(self) - SHOWN_ROWS} more rows")
        return lines

    def to_pandas(self) -> pandas.DataFrame:
        """As a table of pandas (`pip install signorini[pandas]`)."""
        table: pandas.DataFrame = load("pandas", "pandas").DataFrame(self.columns)
        return table

    def to_arrow(self) -> pyarrow.Table:
        """As a table of Arrow (`pip install signorini[arrow]`)."""
        table: pyarrow.Table = load("pyarrow", "arrow").table(self.columns)
        return table


class JobTable(Table):
    """A row for each job: what it is, and the numbers of its result with their errors (`normal_force`,
    `normal_force_error`), NaN where a job has none. `normal_force` is that of the only contact of a job;
    `normal_force.hub` that of the contact `hub`, whatever others there are (column `contacts`).
    """

    def __init__(self, names: Sequence[str], rows: Sequence[Mapping[str, Any]]) -> None:
        super().__init__({name: _column([row[name] for row in rows]) for name in names})


def _column(values: list[Any]) -> Array:
    if all(isinstance(value, str) for value in values):
        return np.array(values, dtype=str)
    if all(isinstance(value, int) for value in values):
        return np.array(values, dtype=np.int64)
    return np.array([np.nan if value is None else value for value in values], dtype=np.float64)


def _cell(value: Any) -> str:
    return f"{value:.5g}" if isinstance(value, float) else str(value)
