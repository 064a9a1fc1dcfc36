"""Robust weights of beams: found anew less and less often, used in between."""

import numpy as np

from rbpf_svgp_slam.gmrf.beam_weights import BeamWeights


class Finder:
    """Finds other weights each time, and counts how often it is asked."""

    def __init__(self):
        self.calls = 0

    def weights(self, weights, first, count):
        return weights.of(first, count, lambda: self._find(count))

    def _find(self, count):
        self.calls += 1
        return np.full(count, 1.0 / (1 + self.calls))


def test_weights_are_found_anew_1_2_4_8_refoldings_after_the_first():
    weights, finder = BeamWeights(), Finder()
    found = []
    for refolding in range(20):
        before = finder.calls
        got = finder.weights(weights, 0, 5)
        # To half precision; as last found.
        np.testing.assert_allclose(got, np.full(5, 1.0 / (1 + finder.calls)), rtol=2**-11)
        if finder.calls > before:
            found.append(refolding)
        weights.begin_refolding()
    assert found == [0, 1, 2, 4, 8, 16]


def test_each_beam_counts_from_its_own_first_refolding():
    weights, finder = BeamWeights(), Finder()
    finder.weights(weights, 0, 3)
    for _ in range(3):
        weights.begin_refolding()
    late = finder.weights(weights, 3, 2)
    assert finder.calls == 2
    early = finder.weights(weights, 0, 3)
    assert finder.calls == 2, "three refoldings after its first, nothing is found anew"
    np.testing.assert_array_equal(early, np.full(3, 0.5))
    assert np.all(late != early[0])
    weights.begin_refolding()  # four after the first three beams, one after the others
    finder.weights(weights, 0, 3)
    finder.weights(weights, 3, 2)
    assert finder.calls == 4


def test_a_block_with_some_beams_that_are_unknown_is_found_anew():
    weights, finder = BeamWeights(), Finder()
    finder.weights(weights, 0, 3)
    finder.weights(weights, 2, 4)
    assert finder.calls == 2
    np.testing.assert_allclose(
        finder.weights(weights, 0, 6), [0.5, 0.5, *np.full(4, 1.0 / 3.0)], rtol=2**-11
    )
    assert finder.calls == 2, "all are known now"
