"""Rows of a sweep in a CSV file, written as soon as they are known; a killed sweep goes on with the rows that are left."""

import csv
import io
from pathlib import Path

from pyomo_fesd.core import FesdError

#: Column with the position of a scenario in the frame.
POSITION = 'scenario'


class ResultsFile:
    """The CSV file of a sweep.

    Parameters
    ----------
    path : str or Path
    columns : list of str
        without ``POSITION``
    given : list of dict
        the scenarios, in their order: a row of the file must have the same values

    Attributes
    ----------
    done : dict position -> dict of text by column
        rows that the file has

    Raises
    ------
    FesdError
        for a file of another sweep
    """

    def __init__(self, path, columns: list[str], given: list[dict]):
        self._path, self._columns = Path(path), [POSITION, *columns]
        self.done = {}
        if self._path.exists() and self._path.stat().st_size:
            self._read(given)
        else:
            self._append(self._columns)

    def add(self, position: int, row: dict) -> None:
        """Append the row of a scenario."""
        self._append([position, *(row.get(name) for name in self._columns[1:])])

    def _append(self, cells):
        line = io.StringIO()
        csv.writer(line, lineterminator='\n').writerow(['' if cell is None else cell for cell in cells])
        with self._path.open('a', newline='', encoding='utf-8') as file:
            file.write(line.getvalue())

    def _read(self, given):
        whole = self._without_half_a_line()
        reader = csv.DictReader(io.StringIO(whole))
        if reader.fieldnames != self._columns:
            raise FesdError(
                f"path='{self._path}'",
                f"sweep: its columns are {', '.join(reader.fieldnames or ())} instead of {', '.join(self._columns)}",
                "give another path, or delete the file",
            )
        for row in reader:
            position = int(row.pop(POSITION))
            if position >= len(given) or any(row[name] != text(cell) for name, cell in given[position].items()):
                raise FesdError(
                    f"path='{self._path}'",
                    f"sweep: its scenario {position} has other values than the frame",
                    "give another path, or delete the file",
                )
            self.done[position] = row

    def _without_half_a_line(self):
        """The lines of the file; the last one, where a kill cut it short, is removed."""
        content = self._path.read_bytes()
        whole = content[: content.rfind(b'\n') + 1]
        if len(whole) < len(content):
            with self._path.open('r+b') as file:
                file.truncate(len(whole))
        return whole.decode('utf-8')


def text(cell) -> str:
    """A cell as the file has it."""
    return '' if cell is None else str(cell)
