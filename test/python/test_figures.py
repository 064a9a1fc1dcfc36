"""The report's figures: what they show, in what units, and what they do without data."""

import dataclasses
import importlib.util
import sys

import matplotlib
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from PIL import Image
from made_up_survey import OF_PINGS, lawn_mower, make_run, without

from rbpf_svgp_slam.evaluation import page
from rbpf_svgp_slam.evaluation.report import write_report
from rbpf_svgp_slam.figures import (
    closure_figures,
    error_figures,
    figure_style,
    map_figures,
    time_lapse_figures,
    track_figures,
    training_figures,
)
from rbpf_svgp_slam.metrics.evaluation import evaluate
from rbpf_svgp_slam.run.closures import Closures
from rbpf_svgp_slam.run.survey_run import GridMap, TimeLapse

MAP_FIGURES = (
    "depth_chart survey_quality trajectories raw_bathymetry posterior seabed_maps "
    "consistency_maps time_lapse"
).split()


def make_time_lapse(run, frames=5):
    """Frames of the map as it is in the end."""
    x, y = run.map.x[::3], run.map.y[::3]
    mean = np.nan_to_num(run.map.mean[::3, ::3], nan=-25.0)
    t_s = np.linspace(run.stamp_s[0] + 60, run.stamp_s[-1], frames)
    return TimeLapse(t_s, x, y, np.stack([mean] * frames))


@pytest.fixture(scope="module")
def run():
    run = make_run()
    return without(run, time_lapse=make_time_lapse(run))


@pytest.fixture(scope="module")
def drawn(run):
    return {name: figure for name, figure, _ in page.draw_figures(run, evaluate(run))}


def plan_views(figure):
    return [axes for axes in figure.axes if axes.images]


@pytest.mark.parametrize("name", MAP_FIGURES)
def test_maps_have_equal_axes_units_and_a_colour_bar(drawn, name):
    figure = drawn[name]
    assert plan_views(figure)
    for axes in plan_views(figure):
        assert axes.get_aspect() == 1
        at = axes.get_subplotspec()
        assert axes.get_xlabel() == ("x (m)" if at.is_last_row() else "")
        assert axes.get_ylabel() == ("y (m)" if at.is_first_col() else "")
    bars = [child for axes in plan_views(figure) for child in axes.child_axes]
    assert bars and all(bar.get_ylabel().endswith(("(m)", "m²)")) for bar in bars)


def test_a_map_is_drawn_where_it_is(drawn, run):
    image = plan_views(drawn["posterior"])[0].images[0]
    x, y = run.map.x, run.map.y
    assert image.get_extent() == (x[0] - 0.5, x[-1] + 0.5, y[0] - 0.5, y[-1] + 0.5)
    shown = image.get_array().filled(np.nan)
    known = np.isfinite(run.seabed.mean).T
    np.testing.assert_array_equal(shown[known], run.map.mean.T[known])
    assert image.origin == "lower"


def test_every_panel_is_masked_as_the_seabed_is(drawn, run):
    known = np.isfinite(run.seabed.mean)
    assert 0.05 < 1 - known.mean() < 0.5
    known &= np.isfinite(run.map.mean)
    for name in ("posterior", "seabed_maps"):
        for axes in plan_views(drawn[name]):
            shown = axes.images[0].get_array()
            np.testing.assert_array_equal(~np.ma.getmaskarray(shown).T, known)


def test_all_seabeds_have_one_scale_of_depths(drawn, run):
    limits = {
        axes.images[0].get_clim()
        for name in MAP_FIGURES
        for axes in plan_views(drawn[name])
        if axes.images[0].cmap == figure_style.DEPTH_MAP
    }
    assert len(limits) == 1
    [bar] = plan_views(drawn["depth_chart"])[0].child_axes
    page.to_png(drawn["depth_chart"])
    depths = [float(text.get_text()) for text in bar.get_yticklabels()]
    assert bar.get_ylabel() == "depth (m)" and (np.diff(depths) < 0).all() and min(depths) > 20


def test_the_seabed_stands_beside_the_particles_map_and_the_truth(drawn, run):
    def titles(figure):
        return [axes.get_title(loc="left") for axes in plan_views(figure)]

    assert titles(drawn["seabed_maps"])[0] == "Seabed"
    assert {"Particle's map", "True seabed", "Seabed − truth"} < set(titles(drawn["seabed_maps"]))
    assert len(titles(drawn["seabed_maps"])) == 8
    with matplotlib.rc_context(figure_style.STYLE):
        blind, _ = map_figures.seabed_maps(without(run, terrain=None), None)
    shown = [title.replace("\n", " ") for title in titles(blind)]
    assert {"Seabed − particle's map", "Seabed − cell means"} < set(shown) and len(shown) == 6


def test_the_deepest_seabed_is_the_darkest():
    shades = figure_style.DEPTH_MAP(np.linspace(0, 1, 20))[:, :3] @ [0.30, 0.59, 0.11]
    assert (np.diff(shades) > 0).all()


def test_without_cmocean_the_maps_are_matplotlib_s(monkeypatch):
    monkeypatch.setitem(sys.modules, "cmocean", None)
    name = figure_style.__name__ + "_without_cmocean"
    spec = importlib.util.spec_from_file_location(name, figure_style.__file__)
    spec.name, module = name, importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    maps = (module.DEPTH_MAP, module.SPREAD_MAP, module.ERROR_MAP, module.DIFFERENCE_MAP)
    assert [m.name for m in maps] == ["viridis", "cividis", "cividis", "PuOr"]


def test_with_cmocean_the_maps_are_the_field_s():
    cm = pytest.importorskip("cmocean").cm
    assert figure_style.DEPTH_MAP == cm.deep_r and figure_style.DIFFERENCE_MAP == cm.balance
    assert figure_style.SPREAD_MAP == cm.matter and figure_style.ERROR_MAP == cm.amp


def test_slopes_that_face_the_sun_are_lit_and_others_in_shadow():
    x = y = np.arange(20.0)
    # A ridge along the diagonal from south-west to north-east: north-west of it faces the sun.
    away = np.abs(np.add.outer(-x, y))
    shade = figure_style.hill_shade(x, y, -away)
    lit, shadow, flat = shade[5, 15], shade[15, 5], figure_style.hill_shade(x, y, 0 * away)
    assert lit[0] == 1 and lit[3] > 0.05 and shadow[0] == 0 and shadow[3] > 0.05
    assert (flat[..., 3] == 0).all()
    unknown = np.where(x[:, None] < 10, np.nan, -away)
    assert (figure_style.hill_shade(x, y, unknown)[:9, :, 3] == 0).all()


def test_elongated_surveys_stack_and_square_ones_stand_side_by_side(run):
    def shape(size_x, size_y, panels=2):
        grid = GridMap(np.arange(size_x), np.arange(size_y), np.zeros((size_x, size_y)))
        figure, axes = figure_style.map_subplots(without(run, map=grid), panels)
        assert figure.get_figheight() <= 11.5
        return axes.shape

    assert shape(300, 60) == (2, 1)
    assert shape(100, 100) == shape(60, 300) == (1, 2)
    assert shape(300, 60, 4) == (4, 1)
    # four tall ones in a row would be too narrow for labels and bars
    assert shape(100, 100, 4) == shape(60, 300, 4) == (2, 2)


def test_titles_of_narrow_maps_keep_off_each_other():
    title = "Particle's map − cell means"
    with matplotlib.rc_context(figure_style.STYLE):
        figure = Figure(figsize=(figure_style.WIDTH_IN, 3))
        panels = figure.subplots(1, 6)
        for axes in panels:
            axes.set(xlim=(0, 2), ylim=(0, 30))
            figure_style.map_axes(axes, title)
        FigureCanvasAgg(figure).draw()
    boxes = [axes._left_title.get_window_extent() for axes in panels]
    assert all(one.x1 < next_one.x0 for one, next_one in zip(boxes, boxes[1:]))
    assert panels[0].get_title(loc="left").replace("\n", " ") == title


def test_shadows_end_with_the_seabed():
    figure = Figure(figsize=(2, 2))
    figure.set_layout_engine("none")  # whatever style is in force: bench sets one for its process
    axes = figure.add_axes([0, 0, 1, 1])
    axes.grid(False)
    z = -0.3 * np.add.outer(np.arange(8.0) ** 2, np.arange(8.0))
    z[4:] = np.nan
    look = {"cmap": "gray", "vmin": -30, "vmax": 0, "interpolation": "bilinear"}
    figure_style.draw_grid(axes, np.arange(8.0), np.arange(8.0), z, relief=True, **look)
    axes.set(facecolor=figure_style.UNKNOWN_COLOUR)
    FigureCanvasAgg(axes.figure).draw()
    pixels = np.asarray(axes.figure.canvas.buffer_rgba())[10:-10, 10:-10, :3]  # without spines
    middle, unknown = pixels.shape[1] // 2, pixels[5, -5]
    assert (pixels[:, middle + 2 :] == unknown).all()
    assert (pixels[:, : middle - 2] != unknown).any(axis=-1).mean() > 0.9


# Bathymetry as measured


def test_raw_bathymetry_is_placed_by_dead_reckoning_and_ignores_outliers(run):
    levelled = run.levelled.copy()
    levelled[::1000, 0], levelled[500::1000] = 1e6, np.nan
    bad = without(run, levelled=levelled)
    raw = map_figures.grid_of_beams(bad, run.dead_reckoning, bad.beams_dead_reckoning)
    low, high = run.dead_reckoning[:, :2].min(axis=0), run.dead_reckoning[:, :2].max(axis=0)
    # A swath of 12 m on either side, and a cell of 1 m.
    assert low[0] - 13 < raw.x[0] < low[0] and high[0] < raw.x[-1] < high[0] + 14
    assert raw.x[1] - raw.x[0] == 1.0
    expected = map_figures.grid_on(raw, run.beams_dead_reckoning)
    both = np.isfinite(raw.mean) & np.isfinite(expected)
    # One beam in 500 is bad: in all other cells nothing has changed.
    assert both.sum() > 0.97 * np.isfinite(expected).sum() > 3000
    assert (raw.mean[both] == expected[both]).mean() > 0.97


def test_raw_cells_are_no_finer_than_the_pings_are_apart(run):
    poses = lawn_mower(lines=1, length_m=2000.0, step_m=4.0)
    few = {name: getattr(run, name)[: len(poses)] for name in OF_PINGS}
    beams = len(poses) * 40
    assert len(few["stamp_s"]) == len(poses)
    sparse = without(
        run, **few, levelled=run.levelled[:beams], ping_of_beam=run.ping_of_beam[:beams]
    )
    sparse.dead_reckoning = poses
    raw = map_figures.grid_of_beams(sparse, poses, sparse.beams_dead_reckoning)
    assert raw.x[1] - raw.x[0] == pytest.approx(4.0)


# Instants at which counters grew


def test_prompts_are_where_their_counter_grew(run):
    t_s = run.stamp_s[0] + 60.0 * np.arange(6)
    history = {"t_s": t_s, "loop_closure_prompts": np.array([3, 3, 4, 4, 9, 9])}
    short = without(run, status_history=history)
    np.testing.assert_allclose(
        track_figures.event_minutes(short, "loop_closure_prompts"), [2.0, 4.0]
    )
    assert len(track_figures.event_minutes(short, "resamplings")) == 0
    assert len(track_figures.event_minutes(without(run, status_history={}), "resamplings")) == 0


@pytest.mark.parametrize("known", [True, False])
def test_prompts_and_resamplings_stand_beside_the_curves(run, known):
    shown = run if known else without(run, ground_truth=None)
    figure, _ = error_figures.position_errors(shown, None)
    [strip] = [
        axes for axes in figure.axes if not axes.get_ylabel() and axes.get_yticks().size == 2
    ]
    ticks = {line.get_label(): line.get_xdata() for line in strip.lines}
    for counter, label in (("loop_closure_prompts", "prompts"), ("resamplings", "resamplings")):
        np.testing.assert_array_equal(ticks[label], track_figures.event_minutes(run, counter))
    assert [label.get_text() for label in strip.get_yticklabels()] == [
        f"prompts ({len(ticks['prompts'])})",
        "resamplings (4)",
    ]
    quiet, _ = error_figures.position_errors(without(shown, status_history={}), None)
    assert len(quiet.axes) == len(figure.axes) - 1


def test_both_estimates_are_drawn_with_what_they_say_of_their_errors(run):
    figure, _ = error_figures.position_errors(run, None)
    panels = {}
    for axes in figure.axes:
        bands = {band.get_label(): band for band in axes.collections}
        for label, band in bands.items():
            panels.setdefault(label, []).append((axes, band.get_paths()[0].vertices[:, 1]))
    for name, label in (("estimate", "±2σ, RBPF"), ("online", "±2σ, RBPF online")):
        _, (axes, band) = panels[label]
        error = getattr(run, name)[:, 1] - run.ground_truth[:, 1]
        np.testing.assert_allclose(axes.lines[0].get_ydata(), error)
        # made_up_survey's covariances are diagonal: yy is the fourth of the triangle.
        two_sigma = 2 * np.sqrt(getattr(run, f"{name}_covariance")[:, 3])
        assert band.max() == pytest.approx(two_sigma.max())
        # One can see it: its widest fills a third of the panel at least, whatever dead reckoning
        # does, and hardly anything is cut off.
        assert two_sigma.max() > axes.get_ylim()[1] / 3
        assert (two_sigma < axes.get_ylim()[1]).mean() > 0.98
    old = without(run, online=None, online_covariance=None, estimate_covariance=None)
    figure, _ = error_figures.position_errors(old, None)
    legend = {text.get_text() for text in figure.axes[0].get_legend().get_texts()}
    assert legend == {"dead reckoning", "RBPF"}


def test_without_ground_truth_the_spread_has_a_panel_of_its_own(run):
    blind = without(run, ground_truth=None)
    figure, _ = error_figures.position_errors(blind, None)
    [axes] = [axes for axes in figure.axes if axes.get_ylabel() == "2σ (m)"]
    lines = {line.get_label(): line.get_ydata() for line in axes.lines}
    xx, yy = run.estimate_covariance[:, [0, 3]].T
    np.testing.assert_allclose(lines["RBPF"], 2 * np.sqrt(np.maximum(xx, yy)))
    [axes] = [axes for axes in figure.axes if axes.get_ylabel() == "in y (m)"]
    lines = {line.get_label(): line.get_ydata() for line in axes.lines}
    np.testing.assert_allclose(lines["RBPF"], run.estimate[:, 1] - run.dead_reckoning[:, 1])


# Loop closures


def test_closures_tie_the_poses_of_their_stamps_together(drawn, run):
    [axes] = plan_views(drawn["loop_closures"])
    assert axes.get_aspect() == 1
    colour_bars = [child.get_ylabel() for child in axes.child_axes]
    assert colour_bars == ["residual of accepted closures (m)"]
    lines = {
        tuple(segment.ravel())
        for collection in axes.collections
        for segment in collection.get_segments()
    }
    position = dict(zip(run.stamp_s, run.estimate[:, :2]))
    stamps = zip(run.closures.stamp_older, run.closures.stamp)
    expected = np.array([np.ravel([position[a], position[b]]) for a, b in stamps])
    np.testing.assert_allclose(sorted(lines), sorted(map(tuple, expected)), atol=1e-6)


def test_the_legend_counts_closures_by_verdict_and_wrong_ones(drawn, run):
    def legend(figure):
        return {text.get_text() for text in plan_views(figure)[0].get_legend().get_texts()}

    counts = {"track", "accepted (13)", "flat (2)", "bad fit (1)"}
    assert legend(drawn["loop_closures"]) == counts | {"wrong (2)"}
    with matplotlib.rc_context(figure_style.STYLE):
        blind, _ = closure_figures.loop_closures(without(run, ground_truth=None), None)
    assert legend(blind) == counts


def test_an_accepted_closure_is_coloured_by_what_the_final_track_departs_from_it(run):
    closures = dataclasses.replace(run.closures)
    # Only the first is accepted, and 3 m wrong, but for its noise: four σ of 0.2 m are allowed.
    closures.verdict = np.where(np.arange(16) == 0, "accepted", "a_new_reason")
    exact = without(run, closures=closures, estimate=run.ground_truth)
    figure, _ = closure_figures.loop_closures(exact, None)
    coloured = [c for c in figure.axes[0].collections if c.get_array() is not None]
    [residual_m] = coloured[0].get_array().tolist()
    assert residual_m == pytest.approx(3.0, abs=0.8)


def test_without_an_accepted_closure_there_is_no_colour_bar(run):
    closures = dataclasses.replace(run.closures, verdict=np.full(16, "flat"))
    figure, _ = closure_figures.loop_closures(without(run, closures=closures), None)
    assert not figure.axes[0].child_axes
    assert page.to_png(figure).startswith(b"\x89PNG")


def test_without_any_closure_there_is_no_figure(run):
    for closures in (None, Closures.of([])):
        assert closure_figures.loop_closures(without(run, closures=closures), None) is None


# Training objective


def test_objective_limits_show_bumps_and_cut_the_start_off():
    objective = 0.2 + 0.02 * np.sin(np.arange(1000.0))
    objective[:10] = np.logspace(6, 1, 10)
    objective[500:520] = 0.3
    low, high = training_figures.objective_limits([objective, np.array([np.nan])])
    assert low < 0.18 and 0.22 < high < 1.0
    calm = objective[600:]
    low, high = training_figures.objective_limits([calm])
    assert low < calm.min() and calm.max() < high
    assert training_figures.objective_limits([np.array([np.nan])]) is None


def test_elbo_is_drawn_with_its_sign_turned_and_the_beams_below(run):
    history = {**run.status_history, "beams": np.arange(len(run.status_history["t_s"]))}
    figure, _ = training_figures.elbo(without(run, status_history=history), None)
    line = figure.axes[0].lines[0]
    np.testing.assert_array_equal(line.get_ydata(), -run.status_history["elbo"])
    minutes = (run.status_history["t_s"] - run.stamp_s[0]) / 60
    np.testing.assert_allclose(line.get_xdata(), minutes)
    assert "nats" in figure.axes[0].get_ylabel() and len(figure.axes) == 2
    alone, _ = training_figures.elbo(run, None)
    assert len(alone.axes) == 1 and alone.axes[0].get_xlabel() == "time (min)"
    unknown = {**history, "elbo": np.full(len(history["t_s"]), np.nan)}
    assert training_figures.elbo(without(run, status_history=unknown), None) is None


def test_the_filters_history_has_a_panel_for_each_known_series(run):
    history = dict(run.status_history)
    t_s = history["t_s"]
    known = {**history, "tau": np.full(len(t_s), 0.5)}
    unknown = {**history, "tau": np.full(len(t_s), np.nan)}  # without prompts
    panels = []
    for series in (known, unknown, history):
        figure, _ = track_figures.filter_history(without(run, status_history=series), None)
        panels.append([axes.get_ylabel() for axes in figure.axes])
    assert panels[1] == panels[2] and panels[0] == [*panels[1], "τ"]


@pytest.mark.parametrize("share", [0.5, 0.25])
def test_the_threshold_is_the_runs_own(run, share):
    config = {**run.config, "resampling": {"threshold": share}}
    figure, caption = track_figures.filter_history(without(run, config=config), None)
    lines = {line.get_label(): line.get_ydata() for line in figure.axes[0].get_lines()}
    assert set(lines[f"threshold {share} J"]) == {share * run.statistics["particles"]}
    assert f"the threshold below which they happen, {share} J" in caption


@pytest.mark.parametrize("config", [{}, {"resampling": "systematic"}])
def test_a_threshold_that_is_not_known_is_not_drawn(run, config):
    figure, caption = track_figures.filter_history(without(run, config=config), None)
    labels = [line.get_label() for line in figure.axes[0].get_lines()]
    assert not any("threshold" in label for label in labels) and "threshold" not in caption


def test_objective_curves_of_several_runs_share_one_axes():
    minutes = np.arange(50.0)
    curves = {f"J = {n}": (minutes, np.cos(minutes) + n) for n in (1, 10, 50, 100)}
    figure, caption = training_figures.objective_curves(curves)
    (axes,) = figure.axes
    assert [line.get_label() for line in axes.lines] == list(curves)
    assert len({line.get_color() for line in axes.lines}) == 4
    assert "evidence lower bound" in caption
    assert page.to_png(figure).startswith(b"\x89PNG")


# Time lapse


def test_seabed_that_no_beam_has_hit_yet_is_left_out(run):
    lapse = run.time_lapse
    known = np.isfinite(time_lapse_figures.seen_seabed(run, lapse))
    x, y, _ = run.beams.T
    stamp_s = run.stamp_s[run.ping_of_beam]
    step_m = lapse.x[1] - lapse.x[0]
    for k, t_s in enumerate(lapse.t_s):
        for i, j in [(5, 10), (20, 3), (30, 20), (40, 12), (0, 0)]:
            centre_m = np.array([lapse.x[i], lapse.y[j]])
            # in the cell or one of those around it
            near = np.maximum(np.abs(x - centre_m[0]), np.abs(y - centre_m[1])) < 1.5 * step_m
            assert known[k, i, j] == np.any(near & (stamp_s <= t_s))
    seen = known.mean(axis=(1, 2))
    assert 0.1 < seen[0] < seen[-1] and np.all(np.diff(seen) >= 0)


def test_grids_finer_than_the_picture_are_averaged():
    z = np.arange(20.0).reshape(4, 5)
    z[0, 0] = np.nan
    z[2:, 4] = np.nan
    x, y, coarse = figure_style._coarser(np.arange(4.0), 10.0 + np.arange(5.0), z, 2)
    np.testing.assert_allclose(x, [0.5, 2.5])
    np.testing.assert_allclose(y, [10.5, 12.5, 14.5])
    expected = [[(1 + 5 + 6) / 3, (2 + 3 + 7 + 8) / 4, (4 + 9) / 2], [13.0, 15.0, np.nan]]
    np.testing.assert_allclose(coarse, expected)
    same = figure_style._coarser(np.arange(4.0), np.arange(5.0), z, 1)
    assert same[2] is z


def test_the_strip_is_evenly_spaced_in_time_and_says_when(drawn, run):
    t_s = np.concatenate([np.arange(0.0, 10.0, 0.1), np.arange(10.0, 101.0)])
    picked = t_s[time_lapse_figures.evenly_spaced(t_s, 6)]
    np.testing.assert_allclose(picked, [0, 20, 40, 60, 80, 100], atol=0.05)
    minutes = (run.time_lapse.t_s - run.stamp_s[0]) / 60
    titles = [axes.get_title(loc="left") for axes in plan_views(drawn["time_lapse"])]
    assert titles == [f"{minute:.1f} min" for minute in minutes]


def test_the_animation_has_every_frame_and_goes_with_the_time_lapse(run, tmp_path):
    write_report(run, tmp_path)
    path = tmp_path / "time_lapse.gif"
    with Image.open(path) as gif:
        assert gif.n_frames == len(run.time_lapse.t_s)
        first = np.asarray(gif.convert("RGB"), dtype=float) / 255
        gif.seek(gif.n_frames - 1)
        last = np.asarray(gif.convert("RGB"), dtype=float) / 255
    grey = [
        (np.abs(frame - to_rgb(figure_style.UNKNOWN_COLOUR)).max(axis=-1) < 0.02).mean()
        for frame in (first, last)
    ]
    # Most of the map's pixels, which are more than half of the picture's; then what no beam hits.
    assert grey[0] > 0.3 and grey[1] < 0.25
    assert "time_lapse.gif" in (tmp_path / "report.html").read_text()
    write_report(without(run, time_lapse=None), tmp_path)
    assert not path.exists()
    assert "time_lapse.gif" not in (tmp_path / "report.html").read_text()
    # A survey of seconds: no map was there when the only frame was taken.
    lapse = run.time_lapse
    empty = TimeLapse(run.stamp_s[:1], lapse.x, lapse.y, np.full_like(lapse.mean[:1], np.nan))
    time_lapse_figures.write_time_lapse_gif(without(run, time_lapse=empty), tmp_path)
    assert not path.exists()
    assert time_lapse_figures.time_lapse(without(run, time_lapse=empty), None) is None


# Runs with little in them


def test_one_ping_makes_figures_and_no_raw_bathymetry(run):
    few = {name: getattr(run, name)[:1] for name in OF_PINGS}
    beams = {"levelled": run.levelled[:40], "ping_of_beam": run.ping_of_beam[:40]}
    one = without(run, **few, **beams, status_history={}, time_lapse=None)
    figures = {name: figure for name, figure, _ in page.draw_figures(one, evaluate(one))}
    # of consistency, only that of the map with the beams
    drawn = "depth_chart survey_quality trajectories posterior seabed_maps consistency_maps"
    assert set(figures) == set(drawn.split())
    assert all(page.to_png(figure) for figure in figures.values())


def test_the_posterior_of_another_program_has_no_variance_and_no_inducing_points(run):
    unknown = np.full(run.map.mean.shape, np.nan)
    for variance in (None, unknown):
        grid = dataclasses.replace(run.map, variance=variance)
        figure, caption = map_figures.posterior(without(run, map=grid), None)
        assert len(figure.axes) == 1 and "variance" not in caption
    for points in (np.empty((0, 3)), np.ones((1001, 3))):  # none, and so many that they hide all
        figure, caption = map_figures.posterior(without(run, support_points=points), None)
        assert len(figure.axes) == 2 and "inducing" not in caption


def test_a_map_without_values_is_not_drawn(run):
    blank = GridMap(run.map.x, run.map.y, np.full(run.map.mean.shape, np.nan))
    empty = without(run, map=blank)
    assert map_figures.posterior(empty, None) is None
    assert map_figures.seabed_maps(empty, None) is None
    nothing = without(run, map=GridMap(np.empty(0), np.empty(0), np.empty((0, 0))))
    figure, _ = track_figures.trajectories(nothing, None)
    assert page.to_png(figure).startswith(b"\x89PNG")
