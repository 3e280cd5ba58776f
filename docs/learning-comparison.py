#!/usr/bin/env python3
"""Draws docs/learning-comparison.svg from the table under "How good it is" in docs/learning.md.

    python3 docs/learning-comparison.py
"""

import pathlib
from xml.sax.saxutils import escape

FOLDER = pathlib.Path(__file__).parent
INKS = ["f6", "f0", "f1", "f4", "f2"]  # floor, the law, the thesis's, one model, windows
STYLE = """.figure{font-family:system-ui,-apple-system,'Segoe UI','DejaVu Sans',sans-serif;font-size:13px;height:auto;max-width:100%}
.strong{font-weight:600}.paper{fill:#ffffff}.ink{fill:#1c242c}.soft{fill:#59636e}.axis{stroke:#aab3bd}
.f0{fill:#2166ac}.f1{fill:#c85a17}.f2{fill:#16836a}.f4{fill:#7a7412}.f6{fill:#87919c}
@media (prefers-color-scheme:dark){.paper{fill:#14181d}.ink{fill:#e8edf2}.soft{fill:#a3aeb9}.axis{stroke:#56616c}
.f0{fill:#79b4ee}.f1{fill:#f0a066}.f2{fill:#5cc9ae}.f4{fill:#c9c254}.f6{fill:#7c8792}}"""
PANEL, NAMES, ROW, BAR, PER_DB = 420, 138, 19, 13, 52


def table():
    """The header's names and, for each row, its title and numbers (None where nothing was measured)."""
    lines = (FOLDER / "learning.md").read_text(encoding="utf-8").splitlines()
    first = next(i for i, line in enumerate(lines) if line.startswith("| log-spectral distance, dB |"))
    cells = lambda line: [cell.strip().replace("**", "") for cell in line.strip("|").split("|")]
    rows = []
    for line in lines[first + 2 :]:
        if not line.startswith("|"):
            break
        title, *numbers = cells(line)
        rows.append((title, [None if number == "–" else number for number in numbers]))
    return cells(lines[first])[1:], rows


def panel(x, y, names, title, numbers):
    """One row of the table as bars."""
    out = [f'<text class="ink strong" x="{x}" y="{y}">{escape(title)}</text>']
    kept = [(name, number, ink) for name, number, ink in zip(names, numbers, INKS) if number]
    for i, (name, number, ink) in enumerate(kept):
        top = y + 10 + ROW * i
        weight = " strong" if ink == "f0" else ""
        middle, width = top + BAR - 2, float(number) * PER_DB
        out.append(f'<text class="soft{weight}" x="{x + NAMES - 6}" y="{middle}" text-anchor="end">{escape(name)}</text>')
        out.append(f'<rect class="{ink}" x="{x + NAMES}" y="{top}" width="{width:.1f}" height="{BAR}"/>')
        out.append(f'<text class="ink{weight}" x="{x + NAMES + width + 5:.1f}" y="{middle}">{number}</text>')
    bottom = y + 10 + ROW * len(kept) - (ROW - BAR)
    out.append(f'<path class="axis" d="M{x + NAMES} {y + 7}V{bottom + 3}"/>')
    return out


def main():
    names, rows = table()
    names = [name.replace(" (default)", "").replace("for the take", "").replace("the thesis's method", "the thesis's")
             .replace("fixed windows, nearest", "nearest").strip() for name in names]
    half, space = (len(rows) + 1) // 2, 36 + ROW * len(names)
    out, height = [], 14 + half * space
    for i, (title, numbers) in enumerate(rows):
        column, row = divmod(i, half)
        out += panel(12 + PANEL * column, 22 + space * row, names, title, numbers)
    svg = [f'<svg xmlns="http://www.w3.org/2000/svg" class="figure" viewBox="0 0 {2 * PANEL} {height}" width="{2 * PANEL}" height="{height}" role="img">',
           "<title>Log-spectral distance of each method, dB: less is better</title>", f"<style>{STYLE}</style>",
           f'<rect class="paper" width="{2 * PANEL}" height="{height}"/>', *out, "</svg>", ""]
    (FOLDER / "learning-comparison.svg").write_text("\n".join(svg), encoding="utf-8")


main()
