// Symmetric positive definite matrices with a narrow band: their factor and what follows from it.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

namespace gmrf {

// Row r has entries in columns envelope[r] .. r, and the envelope never steps back: envelope[r] <=
// envelope[r + 1]. So column c has entries in an unbroken run of rows, which are stored one after
// the other.
class EnvelopeMatrix {
 public:
  explicit EnvelopeMatrix(const std::vector<int>& envelope);

  int size() const { return static_cast<int>(last_.size()); }
  // r >= c, within the envelope.
  double& at(int r, int c) { return values_[offset_[c] + r]; }
  double at(int r, int c) const { return values_[offset_[c] + r]; }

  // A = L L^T, in place. Throws std::domain_error if A is not positive definite.
  void factorise();

  // After factorise().
  double logDeterminant() const;
  void solve(Eigen::VectorXd* b) const;
  // The inverse's entries within the envelope (Takahashi's recursion).
  EnvelopeMatrix inverse() const;

 private:
  // From the diagonal down.
  double* column(int c) { return values_.data() + offset_[c] + c; }
  const double* column(int c) const { return values_.data() + offset_[c] + c; }
  // Entries below the diagonal.
  int below(int c) const { return last_[c] - c; }

  std::vector<int> last_;               // row of each column
  std::vector<std::ptrdiff_t> offset_;  // of each column's row 0, which may not be stored itself
  std::vector<double> values_;
};

}  // namespace gmrf
