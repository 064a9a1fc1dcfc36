"""Shared by all tests of the Python package."""

import sys

import pytest


@pytest.fixture(autouse=True)
def keep_denormals():
    """Training flushes denormals to zero in its whole process; hypothesis refuses to draw then."""
    yield
    if "torch" in sys.modules:
        sys.modules["torch"].set_flush_denormal(False)


@pytest.fixture(scope="module")
def run():
    """The made-up survey with known errors, as a run in memory."""
    from made_up_survey import make_run

    return make_run()


@pytest.fixture(scope="session")
def demo_truth():
    """A quarter of the demo: mission, terrain, waypoints and the vehicle's true trajectory."""
    from small_survey import quarter_of_the_demo

    return quarter_of_the_demo()


@pytest.fixture(scope="session")
def placed_folder(tmp_path_factory):
    """The made-up survey's run folder, with a place on the earth; not to be written into."""
    from made_up_survey import ORIGIN_DEG, make_run, without

    from rbpf_svgp_slam.run.run_files import save_run, save_seabed

    run = make_run()
    folder = tmp_path_factory.mktemp("placed") / "run"
    run = without(run, config={**run.config, "survey_origin": ORIGIN_DEG})
    save_run(run, folder)
    save_seabed(run, folder)
    return folder
