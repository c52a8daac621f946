"""A Figure that shows in a notebook without pyplot."""

import io

from matplotlib.figure import Figure


class NotebookFigure(Figure):
    """A Figure that IPython draws, and that pyplot does not know."""

    def _repr_png_(self) -> bytes:
        """Return the picture; IPython calls this."""
        picture = io.BytesIO()
        self.savefig(picture, format='png')
        return picture.getvalue()
