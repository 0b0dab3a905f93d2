r"""Equations as MathML, which browsers draw themselves: no script, no font service, no network.

`\tag{5}` becomes the number in the margin and the anchor `eq-5`.
"""

from __future__ import annotations

import re

from docutils import nodes
from latex2mathml.converter import convert
from sphinx.application import Sphinx

TAG = re.compile(r"\\tag\{([^}]*)\}")
LEADING = re.compile(r"(<mo[^>]*>&#x000(?:3D|28|2C);</mo>)<mo>&#x02212;</mo>")
BAR = re.compile(r"<mo([^>]*)>&#x0007C;</mo>")
BRACKETED = re.compile(
    r"<mo>&#x0005B;</mo>(<mtable>(?:(?!<mtable>).)*?</mtable>)<mo>&#x0005D;</mo>", re.DOTALL
)


def mathml(latex: str, display: str) -> str:
    """Return the MathML of a formula without its tag."""
    latex = re.sub(r"\{aligned\}", "{align*}", TAG.sub("", latex).strip())
    out = LEADING.sub(r'\1<mo form="prefix">&#x02212;</mo>', convert(latex, display=display))
    out = BAR.sub(r'<mo\1 lspace="0.06em" rspace="0.06em">&#x0007C;</mo>', out)
    # Borders of the table stand in for brackets: not every machine has a font whose brackets stretch.
    out = BRACKETED.sub(lambda m: m[1].replace("<mtable>", '<mtable class="bracketed">', 1), out)
    if re.search(r"<m[ion]>(?:&amp;|&|\\\w*|#)</m", out):
        raise ValueError(f"latex2mathml does not know part of: {latex}")
    return out


def visit_math(writer, node: nodes.math) -> None:
    """Write a formula in a line of text."""
    writer.body.append(mathml(node.astext(), "inline"))
    raise nodes.SkipNode


def visit_displaymath(writer, node: nodes.math_block) -> None:
    """Write a formula on its own, with its number."""
    tag = TAG.search(node.astext())
    ids = "".join(f'<span id="{i}"></span>' for i in node["ids"])
    number = f'<span class="eqno">({tag[1]})</span>' if tag else ""
    writer.body.append(f'<div class="equation">{ids}{mathml(node.astext(), "block")}{number}</div>\n')
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the renderer under the name `mathml`."""
    app.add_html_math_renderer("mathml", (visit_math, None), (visit_displaymath, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
