#include <cmath>
#include <stdexcept>
#include <string>

#include "gmrf/window.hpp"

namespace gmrf {

namespace {

using Strip = Eigen::Map<Eigen::VectorXd>;
using ConstStrip = Eigen::Map<const Eigen::VectorXd>;

}  // namespace

EnvelopeMatrix::EnvelopeMatrix(std::vector<int> envelope) : envelope_(std::move(envelope)) {
  offset_.reserve(envelope_.size());
  std::ptrdiff_t stored = 0;
  for (int r = 0; r < size(); ++r) {
    offset_.push_back(stored - envelope_[r]);
    stored += r - envelope_[r] + 1;
  }
  values_.assign(static_cast<std::size_t>(stored), 0.0);
}

void EnvelopeMatrix::factorise() {
  for (int r = 0; r < size(); ++r) {
    double* row = values_.data() + offset_[r];
    const int first = envelope_[r];
    for (int c = first; c < r; ++c) {
      // envelope[c] <= envelope[r] = first: the products begin at `first`.
      const double* above = values_.data() + offset_[c];
      const double sum =
          ConstStrip(row + first, c - first).dot(ConstStrip(above + first, c - first));
      row[c] = (row[c] - sum) / above[c];
    }
    const double rest = row[r] - ConstStrip(row + first, r - first).squaredNorm();
    if (!(rest > 0.0)) {
      throw std::domain_error("precision is not positive definite at node " + std::to_string(r));
    }
    row[r] = std::sqrt(rest);
  }
}

double EnvelopeMatrix::logDeterminant() const {
  double sum = 0.0;
  for (int r = 0; r < size(); ++r) sum += std::log(at(r, r));
  return 2.0 * sum;
}

void EnvelopeMatrix::solve(Eigen::VectorXd* b) const {
  double* x = b->data();
  for (int r = 0; r < size(); ++r) {
    const double* row = values_.data() + offset_[r];
    const int first = envelope_[r];
    x[r] -= ConstStrip(row + first, r - first).dot(ConstStrip(x + first, r - first));
    x[r] /= row[r];
  }
  for (int r = size() - 1; r >= 0; --r) {
    const double* row = values_.data() + offset_[r];
    const int first = envelope_[r];
    x[r] /= row[r];
    Strip(x + first, r - first) -= x[r] * ConstStrip(row + first, r - first);
  }
}

// S L = L^-T is upper triangular, so that for i >= j
//   S_ij = (d_ij / L_jj - sum_{k > j} S_ik L_kj) / L_jj:
// column by column from the last. All S_ik that are needed lie within the envelope.
EnvelopeMatrix EnvelopeMatrix::inverse() const {
  EnvelopeMatrix S(envelope_);
  Eigen::VectorXd column(size());
  Eigen::VectorXd product(size());
  int last = size() - 1;  // of the rows whose envelope reaches column j
  for (int j = size() - 1; j >= 0; --j) {
    while (last > j && envelope_[last] > j) --last;
    const int m = last - j;
    for (int k = 1; k <= m; ++k) column(k - 1) = at(j + k, j);
    // The symmetric block S of rows and columns j + 1 .. last, of which the lower half is stored.
    product.head(m).setZero();
    for (int k = 0; k < m; ++k) {
      const int r = j + 1 + k;
      const ConstStrip row(S.values_.data() + S.offset_[r] + j + 1, k);
      product(k) += row.dot(column.head(k)) + S.at(r, r) * column(k);
      product.head(k) += column(k) * row;
    }
    const double diagonal = at(j, j);
    for (int k = 0; k < m; ++k) S.at(j + 1 + k, j) = -product(k) / diagonal;
    const double sum = -product.head(m).dot(column.head(m)) / diagonal;  // of S_jk L_kj
    S.at(j, j) = (1.0 / diagonal - sum) / diagonal;
  }
  return S;
}

}  // namespace gmrf
