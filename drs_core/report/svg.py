"""A figure as SVG inside a page: the page's fonts and colours, and names that no other figure has."""

from __future__ import annotations

import io
import re
from typing import TYPE_CHECKING

from drs_core.reporting.colours import CSS_NAMES

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_MARK = re.compile("|".join(CSS_NAMES))


def inline_svg(figure: Figure, name: str, label: str) -> str:
    """The figure, drawn in the palette THEMED, as an ``<svg>`` element; `label` is what it shows, in words."""
    import matplotlib
    from markupsafe import escape

    buffer = io.StringIO()
    # text stays text, and the same figure gives the same bytes
    with matplotlib.rc_context({"svg.fonttype": "none", "svg.hashsalt": name}):
        figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None, "Format": None, "Type": None})
    text = buffer.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    # several figures share one page: their names must not meet
    text = re.sub(r'\bid="', f'id="{name}-', text)
    text = re.sub(r'(url\(#|href="#)', rf"\g<1>{name}-", text)
    text = _MARK.sub(lambda match: CSS_NAMES[match.group()], text)
    head, rest = text.split(">", 1)
    view = re.search(r'viewBox="[^"]*"', head)
    opening = f'<svg role="img" aria-label="{escape(label)}" {view.group() if view else ""}'
    return f'{opening} xmlns:xlink="http://www.w3.org/1999/xlink">{rest.rstrip()}'
