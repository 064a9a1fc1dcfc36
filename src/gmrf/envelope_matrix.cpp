#include "gmrf/envelope_matrix.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

namespace gmrf {

namespace {

// Columns that are taken off those that follow at once: these are then read and written once.
constexpr int kPanel = 4;

// y += a x and y . x, of n numbers that do not overlap.
void addTo(double* __restrict y, double a, const double* __restrict x, int n) {
  for (int i = 0; i < n; ++i) y[i] += a * x[i];
}

// y += X a, of a panel's columns X, each `stride` after the one before, one after the other.
void addTo(double* __restrict y, const double (&a)[kPanel], const double* __restrict x,
           std::ptrdiff_t stride, int n) {
  static_assert(kPanel == 4);
  for (int i = 0; i < n; ++i) {
    y[i] = y[i] + a[0] * x[i] + a[1] * x[i + stride] + a[2] * x[i + 2 * stride] +
           a[3] * x[i + 3 * stride];
  }
}

double dot(const double* y, const double* x, int n) {
  return Eigen::Map<const Eigen::VectorXd>(y, n).dot(Eigen::Map<const Eigen::VectorXd>(x, n));
}

}  // namespace

EnvelopeMatrix::EnvelopeMatrix(const std::vector<int>& envelope) {
  const int n = static_cast<int>(envelope.size());
  last_.reserve(envelope.size());
  offset_.reserve(envelope.size());
  std::ptrdiff_t stored = 0;
  int last = 0;
  for (int c = 0; c < n; ++c) {
    while (last + 1 < n && envelope[last + 1] <= c) ++last;
    last_.push_back(last);
    offset_.push_back(stored - c);
    stored += last - c + 1;
  }
  values_.assign(static_cast<std::size_t>(stored), 0.0);
}

// Panel by panel: each is taken off all that follow.
void EnvelopeMatrix::factorise() {
  std::vector<double> panel;
  for (int first = 0; first < size(); first += kPanel) {
    const int after = std::min(first + kPanel, size());
    for (int c = first; c < after; ++c) {
      double* L = column(c);
      if (!(L[0] > 0.0)) {
        throw std::domain_error("precision is not positive definite at node " + std::to_string(c));
      }
      L[0] = std::sqrt(L[0]);
      const double inverse = 1.0 / L[0];
      for (int k = 1; k <= below(c); ++k) L[k] *= inverse;
      for (int r = c + 1; r < std::min(after, last_[c] + 1); ++r) {
        addTo(column(r), -L[r - c], L + (r - c), last_[c] - r + 1);
      }
    }
    // What lies below the panel, with zeros where its columns end before the last one.
    const int rows = last_[after - 1] - after + 1;
    if (rows == 0) continue;  // always so of the last panel, which may have fewer columns
    panel.assign(static_cast<std::size_t>(kPanel) * rows, 0.0);
    for (int p = 0; p < kPanel; ++p) {
      const double* L = column(first + p);
      std::copy(L + std::min(after - first - p, below(first + p) + 1), L + below(first + p) + 1,
                panel.data() + static_cast<std::ptrdiff_t>(p) * rows);
    }
    for (int k = 0; k < rows; ++k) {
      const double* x = panel.data() + k;
      addTo(column(after + k), {-x[0], -x[rows], -x[2 * rows], -x[3 * rows]}, x, rows, rows - k);
    }
  }
}

double EnvelopeMatrix::logDeterminant() const {
  double sum = 0.0;
  for (int c = 0; c < size(); ++c) sum += std::log(*column(c));
  return 2.0 * sum;
}

void EnvelopeMatrix::solve(Eigen::VectorXd* b) const {
  double* x = b->data();
  for (int c = 0; c < size(); ++c) {
    const double* L = column(c);
    x[c] /= L[0];
    addTo(x + c + 1, -x[c], L + 1, below(c));
  }
  for (int c = size() - 1; c >= 0; --c) {
    const double* L = column(c);
    x[c] = (x[c] - dot(L + 1, x + c + 1, below(c))) / L[0];
  }
}

// S L = L^-T is upper triangular, so that for i >= j
//   S_ij = (d_ij / L_jj - sum_{k > j} S_ik L_kj) / L_jj:
// column by column from the last. All S_ik that are needed lie within the envelope.
EnvelopeMatrix EnvelopeMatrix::inverse() const {
  EnvelopeMatrix S = *this;
  std::vector<double> product(static_cast<std::size_t>(size()));
  for (int j = size() - 1; j >= 0; --j) {
    const int m = below(j);
    const double* L = column(j);
    const double scale = -1.0 / L[0];
    // Of S's rows and columns j + 1 .. j + m, of which the lower half is stored, with L.
    std::fill_n(product.begin(), m, 0.0);
    for (int k = 0; k < m; ++k) {
      const double* of_k = S.column(j + 1 + k);
      addTo(product.data() + k, L[1 + k], of_k, m - k);
      product[k] += dot(of_k + 1, L + 2 + k, m - k - 1);
    }
    double* of_j = S.column(j);
    for (int k = 0; k < m; ++k) of_j[1 + k] = scale * product[k];
    of_j[0] = (-scale - dot(of_j + 1, L + 1, m)) * -scale;
  }
  return S;
}

}  // namespace gmrf
