"""Maps as Gaussian Markov random fields, computed by the C++ library src/gmrf."""
