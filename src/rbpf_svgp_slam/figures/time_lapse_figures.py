"""One particle's map as it grew: a strip of frames for the report, and an animation.

Grey is seabed that no beam had hit by then.
"""

from __future__ import annotations

from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from PIL import Image
from scipy.ndimage import minimum_filter

from rbpf_svgp_slam.figures import figure_style as style
from rbpf_svgp_slam.figures.track_figures import Drawn
from rbpf_svgp_slam.metrics.evaluation import Evaluation
from rbpf_svgp_slam.run.survey_run import SurveyRun, TimeLapse

GIF_NAME = "time_lapse.gif"
_STRIP_HEIGHT_IN = 7.5
_GIF_WIDTH_IN, _GIF_DPI = 5.8, 100
_GIF_MARGINS_IN = (0.65, 0.5, 0.95, 0.35)  # left, bottom, right, top
_GIF_COLOURS = 112
_FRAME_MS, _LAST_FRAME_MS = 170, 2000


def seen_seabed(run: SurveyRun, lapse: TimeLapse) -> np.ndarray:
    """Return the means [K, nx, ny], m, NaN where no beam had hit by then, placed with the estimate.

    A cell beside one that was hit counts as hit: beams are sparse at the swath's edge.
    """
    seen_s = minimum_filter(first_seen_s(run, lapse), size=3)
    return np.where(seen_s <= lapse.t_s[:, None, None], lapse.mean, np.nan)


def first_seen_s(run: SurveyRun, lapse: TimeLapse) -> np.ndarray:
    """Return the stamp [nx, ny] of the first ping with a beam in each cell, inf where none has."""
    seen_s = np.full((len(lapse.x), len(lapse.y)), np.inf)
    i, j = (
        np.rint((run.beams[:, axis] - centres[0]) / max(np.ptp(centres[:2]), 1e-9))
        for axis, centres in enumerate((lapse.x, lapse.y))
    )
    # Not finite is not inside.
    inside = (i >= 0) & (i < seen_s.shape[0]) & (j >= 0) & (j < seen_s.shape[1])
    cell = (i[inside] * seen_s.shape[1] + j[inside]).astype(np.int64)
    # Beams are in the order of their pings: the first of a cell is the earliest.
    cells, first = np.unique(cell, return_index=True)
    seen_s.flat[cells] = run.stamp_s[run.ping_of_beam[np.flatnonzero(inside)[first]]]
    return seen_s


def _shown_seabed(run: SurveyRun) -> np.ndarray | None:
    """The seabed of the run's frames as seen_seabed() has it; None where no frame shows any."""
    lapse = run.time_lapse
    if lapse is None or not len(lapse.t_s) or not len(run.stamp_s):
        return None
    seabed = seen_seabed(run, lapse)
    return seabed if np.isfinite(seabed).any() else None


def time_lapse(run: SurveyRun, evaluation: Evaluation) -> Drawn:
    """Draw a strip of frames, evenly spaced in time; None without a time lapse."""
    lapse, seabed = run.time_lapse, _shown_seabed(run)
    if seabed is None:
        return None
    frames = evenly_spaced(lapse.t_s, 8 if style.plan_aspect(run) > 0.8 else 6)
    figure, panels = style.map_subplots(run, len(frames), _STRIP_HEIGHT_IN)
    colours = style.depth_colours(run)
    for axes, k in zip(panels.flat, frames):
        image = _draw_frame(axes, run, k, seabed[k], colours)
    style.depth_bar(image)
    return figure, (
        "The map of the particle that was the best at each time, with the way of the vehicle so "
        f"far; grey where no beam had hit the seabed yet. All {len(lapse.t_s)} "
        f"frames: {GIF_NAME} beside this page."
    )


def evenly_spaced(t_s: np.ndarray, count: int) -> np.ndarray:
    """Return the indices of at most `count` of the stamps t_s [K], s, evenly spaced in time."""
    wanted = np.linspace(t_s[0], t_s[-1], count)
    return np.unique(np.abs(t_s[:, None] - wanted).argmin(axis=0))


def write_time_lapse_gif(run: SurveyRun, out_dir: Path) -> None:
    """Write the animation; nothing without a time lapse."""
    path = out_dir / GIF_NAME
    seabed = _shown_seabed(run)
    if seabed is None:
        return
    with matplotlib.rc_context({**style.STYLE, "figure.dpi": _GIF_DPI}):
        frames = _animation(run, seabed)
    palette = _palette(frames)
    frames = [frame.quantize(palette=palette, dither=0) for frame in frames]
    durations_ms = [_FRAME_MS] * (len(frames) - 1) + [_LAST_FRAME_MS]
    frames[0].save(
        path, save_all=True, append_images=frames[1:], duration=durations_ms, loop=0, optimize=True
    )


def _palette(frames: list[Image.Image]) -> Image.Image:
    """Return an image with the palette for all frames.

    One for all: it spares a palette a frame, and what does not change between two frames stays the
    same to the pixel, so that it costs no bytes. The last frame has all of the seabed.
    """
    few = [to_rgb(c) for c in ("white", "black", style.UNKNOWN_COLOUR, style.VEHICLE_COLOUR)]
    many = frames[-1].quantize(_GIF_COLOURS - len(few)).getpalette()
    palette = Image.new("P", (1, 1))
    palette.putpalette(
        [round(255 * c) for colour in few for c in colour] + many[: 3 * (_GIF_COLOURS - len(few))]
    )
    return palette


def _animation(run: SurveyRun, seabed: np.ndarray) -> list[Image.Image]:
    """Return the frames [K] of a seabed [K, nx, ny], m, all of one size and layout."""
    colours = style.depth_colours(run)
    # Placed by hand: matplotlib's own layout would double the time of every frame.
    left_in, bottom_in, right_in, top_in = _GIF_MARGINS_IN
    map_in = _GIF_WIDTH_IN - left_in - right_in
    height_in = map_in * min(style.plan_aspect(run), 1.0) + bottom_in + top_in
    figure = Figure(figsize=(_GIF_WIDTH_IN, height_in), constrained_layout=False)
    canvas = FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    edges = {"left": left_in / _GIF_WIDTH_IN, "right": 1 - right_in / _GIF_WIDTH_IN}
    figure.subplots_adjust(bottom=bottom_in / height_in, top=1 - top_in / height_in, **edges)
    images = []
    for k, z in enumerate(seabed):
        axes.clear()
        style.depth_bar(_draw_frame(axes, run, k, z, colours))
        canvas.draw()
        images.append(Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB"))
    return images


def _draw_frame(axes: Axes, run: SurveyRun, k: int, z: np.ndarray, colours: dict) -> AxesImage:
    """Draw frame k, seabed z [nx, ny] in m, with the vehicle and its way so far."""
    lapse = run.time_lapse
    image = style.draw_grid(
        axes, lapse.x, lapse.y, z, interpolation="bilinear", relief=True, **colours
    )
    way = run.estimate[run.stamp_s <= lapse.t_s[k], :2]
    axes.plot(*way.T, color="black", linewidth=0.5, alpha=0.6)
    axes.plot(*way[-1:].T, "o", color=style.VEHICLE_COLOUR, mec="white", ms=5)
    axes.set_xlim(*image.get_extent()[:2])
    axes.set_ylim(*image.get_extent()[2:])
    style.map_axes(axes, f"{style.minutes_since_start(run, lapse.t_s[k]):.1f} min")
    return image
