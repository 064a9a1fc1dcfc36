"""A run in memory: its arrays belong together."""

import numpy as np
import pytest
from made_up_survey import without


def test_wrong_shapes_are_named(run):
    with pytest.raises(ValueError, match=r"held_out: expected shape \(\d+,\), got \(2,\)"):
        without(run, held_out=np.zeros(2, dtype=bool))
    with pytest.raises(ValueError, match="ping_of_beam: expected indices"):
        without(run, ping_of_beam=run.ping_of_beam + 10_000)
