"""What the recorder makes of the statuses that it has heard."""

import math
from types import SimpleNamespace

from rbpf_svgp_slam.recorder.assembly import _median


def test_times_count_once_however_often_they_are_reported():
    # before the first prompt; one of 0.3 s, reported three times; 0.1 s; 0.2 s
    reported = [(0, math.nan), (1, 0.3), (1, 0.3), (1, 0.3), (2, 0.1), (3, 0.2)]
    statuses = [SimpleNamespace(prompts=count, prompt_s=time_s) for count, time_s in reported]
    assert _median(statuses, "prompt_s", "prompts") == 0.2
    assert math.isnan(_median(statuses[:1], "prompt_s", "prompts"))
