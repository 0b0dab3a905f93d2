"""A card as text, as one HTML file, and as one page of PDF: each alone, with nothing beside it."""

from __future__ import annotations

import html
import io
import textwrap
from collections.abc import Iterator
from pathlib import Path

from passiflex.cards import Card
from passiflex.cards.sheet import Block, Table, sheet, title
from passiflex.errors import NameUnknownError
from passiflex.files import whole_file

WIDTH = 110
FORMS = (".html", ".pdf", ".txt")
STYLE = """
body { font: 15px/1.45 system-ui, sans-serif; max-width: 62rem; margin: 2rem auto; padding: 0 1rem; color: #1d2b36; }
h1 { font-size: 1.5rem; } h2 { font-size: 1.05rem; margin: 1.4rem 0 .3rem; color: #33658a; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; } p { margin: .3rem 0; }
th, td { text-align: left; padding: .15rem .9rem .15rem 0; border-bottom: 1px solid #d8e0e6; vertical-align: top; }
figure { float: right; margin: 0 0 1rem 1rem; } code { background: #eef2f5; padding: .1rem .3rem; }
@media print { body { margin: 0; font-size: 10px; } h2 { margin: .6rem 0 .1rem; } }
"""


def card_text(card: Card) -> str:
    """Return a card as text."""
    lines = [f"passiflex card: {title(card)}", ""]
    for block in sheet(card):
        lines += [*_text(block), ""]
    return "\n".join(lines).rstrip() + "\n"


def _text(block: Block) -> Iterator[str]:
    yield block.title.upper()
    for line in block.lines:
        yield from textwrap.wrap(line, WIDTH, initial_indent="  ", subsequent_indent="    ")
    if block.table is not None:
        columns, rows = block.table
        widths = [max(len(row[i]) for row in (columns, *rows)) for i in range(len(columns))]
        for row in (columns, *rows):
            yield (
                "  " + "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True))
            ).rstrip()


def card_html(card: Card) -> str:
    """Return a card as one HTML page."""
    from passiflex.plotting.card import draw_card

    picture = io.StringIO()
    draw_card(card).savefig(picture, format="svg", metadata={"Date": None})
    svg = picture.getvalue()
    body = "".join(_html(block) for block in sheet(card))
    name = html.escape(title(card))
    return (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{name}</title><style>{STYLE}</style></head>'
        f"<body><figure>{svg[svg.index('<svg') :]}</figure><h1>{name}</h1>{body}</body></html>\n"
    )


def _html(block: Block) -> str:
    lines = "".join(f"<p>{html.escape(line)}</p>" for line in block.lines)
    return (
        f"<h2>{html.escape(block.title)}</h2>{lines}{'' if block.table is None else _html_table(block.table)}"
    )


def _html_table(table: Table) -> str:
    head = "".join(f"<th>{html.escape(cell)}</th>" for cell in table.columns)
    rows = ("".join(f"<td>{html.escape(cell)}</td>" for cell in row) for row in table.rows)
    return f"<table><tr>{head}</tr>{''.join(f'<tr>{row}</tr>' for row in rows)}</table>"


def write_card(card: Card, path: str | Path) -> Path:
    """Write a card, in the form that the path's ending says, whole or not at all, and return the path.

    Raises
    ------
    NameUnknownError
        If the path has another ending.
    OutputError
        If the file cannot be written.
    """
    path = Path(path)
    if path.suffix not in FORMS:
        raise NameUnknownError("ending of a card", path.suffix, FORMS)
    with whole_file(path) as temporary:
        if path.suffix == ".pdf":
            from passiflex.plotting.card import draw_page

            draw_page(card, card_text(card)).savefig(temporary, format="pdf", metadata={"CreationDate": None})
        else:
            text = card_text(card) if path.suffix == ".txt" else card_html(card)
            temporary.write_text(text, encoding="utf-8")
    return path
