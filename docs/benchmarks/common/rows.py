"""Measured rows in a CSV file, one a run; a run that has its row is not repeated."""

import csv


class Rows:
    """The rows of a study; each is written to the file at once.

    Parameters
    ----------
    path : Path
    key : sequence of str
        columns that identify a run
    columns : sequence of str
        columns of a new file; an existing file keeps its own
    digits : int
        significant digits of floats, except those of the key
    fresh : bool
        delete an existing file
    """

    def __init__(self, path, key, columns, digits=6, fresh=False):
        self.path, self.key, self.digits = path, tuple(key), digits
        if fresh or not path.exists():
            self._write('w', columns)
        with path.open(newline='') as file:
            reader = csv.DictReader(file)
            self._done = {_identity(row[name] for name in self.key) for row in reader}
            self.columns = reader.fieldnames

    def __contains__(self, run):
        """Whether a run, the values of ``key`` in their order, has a row."""
        return _identity(run) in self._done

    def add(self, row):
        """Append a row, a dict by column; columns without a value stay empty."""
        surplus = set(row) - set(self.columns)
        if surplus:
            raise ValueError(f"{self.path.name} has no column {', '.join(sorted(surplus))}")
        self._write('a', [self._cell(name, row.get(name)) for name in self.columns])
        self._done.add(_identity(row[name] for name in self.key))

    def _write(self, mode, cells):
        with self.path.open(mode, newline='') as file:
            csv.writer(file, lineterminator='\n').writerow(cells)

    def _cell(self, name, value):
        if value is None or value != value:
            return ''
        return f'{value:.{self.digits}g}' if isinstance(value, float) and name not in self.key else value


def _identity(values):
    """Values of a key such that numbers are equal to their text in the file."""
    return tuple(map(_number_or_text, values))


def _number_or_text(value):
    try:
        return float(value)
    except ValueError:
        return str(value)
