// The model that a sample of beams speaks for: maximum marginal likelihood.
#pragma once

#include <vector>

#include "gmrf/map.hpp"

namespace gmrf {

// Beams near to each other, such as a stretch of a swath, with their weights.
struct Sample {
  Beams beams;
  Eigen::VectorXd weights;
};

// Nodes around a sample's beams that belong to its field.
constexpr int kMarginOfSample = 2;

// log p(z) of a sample under a model, nats, with the mean of the weighted depths as the field's.
// Beams must be finite, and within some thousand nodes of each other.
double logEvidence(const Sample& sample, const Model& model);

// The model of most evidence at the given spacing: l, o and sigma^2 from where `start` has them,
// over all samples together. Weak priors keep l and sigma^2 from going astray where the beams say
// little of them.
Model mostEvident(const std::vector<Sample>& samples, const Model& start);

}  // namespace gmrf
