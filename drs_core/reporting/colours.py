"""Colours of all figures: before and after differ for every kind of colour vision (Okabe and Ito, 2008)."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Palette:
    """Colours as #rrggbb; axes are of the three coordinates."""

    foreground: str
    muted: str
    grid: str
    before: str
    after: str
    goal: str
    axes: tuple[str, str, str]

    def side(self, label: str) -> str:
        """The colour of ``before`` or ``after``."""
        return self.after if label == "after" else self.before


LIGHT = Palette("#1c2126", "#59636e", "#d5dae0", "#b84700", "#0068a6", "#007a57", ("#1c2126", "#007a57", "#a8488a"))
"""On white; every colour but the grid's has a contrast of at least 4.5 with it."""

THEMED = Palette("#010101", "#010102", "#010103", "#010104", "#010105", "#010106", ("#010107", "#010108", "#010109"))
"""Marks that a page replaces by its own colours: see CSS_NAMES."""

CSS_NAMES = {
    "#010101": "var(--text)",
    "#010102": "var(--muted)",
    "#010103": "var(--line)",
    "#010104": "var(--before)",
    "#010105": "var(--after)",
    "#010106": "var(--goal)",
    "#010107": "var(--axis-x)",
    "#010108": "var(--axis-y)",
    "#010109": "var(--axis-z)",
}
"""What stands in a style sheet for each mark of THEMED."""
