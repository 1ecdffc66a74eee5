"""A figure whose files are as papers need them, whatever matplotlib's settings are when it is saved."""

from __future__ import annotations

from typing import Any

from matplotlib import figure, rc_context

SAVED: Any = {
    # letters stay letters in vector files, so that a journal's editor can search and change them
    "svg.fonttype": "none",
    "pdf.fonttype": 42,
    "ps.fonttype": 42,
    "savefig.dpi": 300,
}
"""Settings that matplotlib reads when a figure is saved, not when it is made."""


class Figure(figure.Figure):
    """A figure of matplotlib that is saved with these settings; `dpi=` of `savefig` goes before them."""

    def savefig(self, *args: Any, **options: Any) -> None:
        with rc_context(SAVED):
            super().savefig(*args, **options)
