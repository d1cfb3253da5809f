"""HTML that notebooks show instead of a repr."""

from __future__ import annotations

import base64
import html
from collections.abc import Iterable


def table(rows: Iterable[Iterable[object]], heading: Iterable[object] = ()) -> str:
    """A table of texts, which are escaped."""
    lines = [_row("th", heading)] if heading else []
    return f"<table>{''.join([*lines, *(_row('td', row) for row in rows)])}</table>"


def image(png: bytes) -> str:
    """A picture."""
    return f'<img src="data:image/png;base64,{base64.b64encode(png).decode()}">'


def text(words: object) -> str:
    """A paragraph, escaped."""
    return f"<p>{html.escape(str(words))}</p>"


def _row(tag: str, cells: Iterable[object]) -> str:
    return f"<tr>{''.join(f'<{tag}>{html.escape(str(cell))}</{tag}>' for cell in cells)}</tr>"
