"""Pieces of a page: tables, pictures inside it, numbers with their intervals."""

from __future__ import annotations

import base64
import html
from collections.abc import Mapping, Sequence

from tega.study.figures import p_text

__all__ = ["anchor_of", "esc", "fold", "number", "p_value", "picture", "table", "with_interval"]


def table(head: Sequence[str], rows: Sequence[Sequence[str]], note: str) -> str:
    """Return a table with its note below."""
    top = "".join(f'<th scope="col">{esc(cell)}</th>' for cell in head)
    body = "".join("<tr>" + "".join(f"<td>{cell}</td>" for cell in row) + "</tr>\n" for row in rows)
    caption = f"<caption>{note}</caption>" if note else ""
    return f'<div class="wide"><table>{caption}<thead><tr>{top}</tr></thead><tbody>\n{body}</tbody></table></div>'


def picture(figures: Mapping[str, str], name: str, caption: str) -> str:
    """Return a drawing by name with its caption, inside the page; nothing where there is none."""
    if name not in figures:
        return ""
    # As a picture of its own: ids of several drawings in one page would be mixed up.
    data = base64.b64encode(figures[name].encode()).decode()
    text = esc(caption)
    return f'<figure><img src="data:image/svg+xml;base64,{data}" alt="{text}"><figcaption>{text}</figcaption></figure>'


def fold(title: str, content: str) -> str:
    """Return content that is folded away until asked for."""
    return f"<details><summary>{title}</summary>{content}</details>"


def anchor_of(name: str, condition: str) -> str:
    """Return the name of the place in the page where a cell's trials are."""
    return f"cell-{esc(name)}-{esc(condition)}"


def esc(text: str) -> str:
    """Return text with HTML's own signs made harmless."""
    return html.escape(text)


def number(value: float | None, digits: int = 2) -> str:
    """Return a number with so many decimals."""
    return "–" if value is None else f"{value:.{digits}f}".replace("-", "−")


def p_value(p: float | None) -> str:
    """Return a p-value as it stands in a table."""
    return "–" if p is None else p_text(p).removeprefix("p = ").removeprefix("p ").replace("< ", "&lt;&nbsp;")


def with_interval(value: float | None, low: float | None, high: float | None) -> str:
    """Return an effect with its interval."""
    if value is None:
        return "–"
    return number(value) + (
        "" if low is None else f" ({number(low)} to {'∞' if high is None else number(high)})"
    )
