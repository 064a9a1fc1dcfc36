"""Text as an image."""

from __future__ import annotations

from typing import Sequence

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from rbpf_svgp_slam.display.status_rows import Row

#: Of the whole image, pixels, whatever it says: RViz scales it to its panel.
WIDTH, HEIGHT = 440, 240
ROWS = 6
_DPI = 100
# RViz's own, in config/slam.rviz.
_BACKGROUND = "#181a1e"
_LABEL, _VALUE, _ALARMING = "#9aa3ad", "#ffffff", "#ff9a4d"


def text_image(rows: Sequence[Row]) -> np.ndarray:
    """Up to 6 rows as red, green and blue [240, 440, 3], uint8."""
    if len(rows) > ROWS:
        raise ValueError(f"{len(rows)} rows, expected at most {ROWS}")
    figure = Figure(figsize=(WIDTH / _DPI, HEIGHT / _DPI), dpi=_DPI, facecolor=_BACKGROUND)
    canvas = FigureCanvasAgg(figure)
    for k, row in enumerate(rows):
        y = 1.0 - (k + 0.5) / ROWS
        style = {"va": "center", "fontsize": 14}
        figure.text(0.03, y, row.label, color=_LABEL, **style)
        figure.text(0.33, y, row.value, color=_ALARMING if row.alarming else _VALUE, **style)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3].copy()
