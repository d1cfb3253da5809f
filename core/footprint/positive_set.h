// The coefficients above 0 of
//
//   min x' N x / 2 - b' x,  x_k >= 0 but for the first to enter, which may have any sign
//
// as an active set (Lawson and Hanson 1974): coefficients enter, and those that the joint minimum would make
// negative leave. The Cholesky factor of N's rows of the set gains and loses rows with them (Golub and Van
// Loan, 6.5).
#pragma once

#include <Eigen/Dense>
#include <cstddef>
#include <vector>

namespace glasswing {

// L of G = L L', row after row, and u of L u = b.
class GrowingFactor {
 public:
  size_t size() const { return rows_.size(); }
  double diagonal(size_t k) const { return rows_[k][k]; }

  // `row`: of G, its diagonal last. False if it hardly differs from those before.
  bool append(std::vector<double> row, double b);
  // Row and column `gone` of G.
  void remove(size_t gone);
  void set_right(const std::vector<double>& b);
  // Of G x = b.
  std::vector<double> solution() const;
  // Of G's inverse.
  std::vector<double> inverse_diagonal() const;

 private:
  std::vector<std::vector<double>> rows_;
  std::vector<double> turned_;  // u
};

class PositiveSet {
 public:
  explicit PositiveSet(size_t count) : is_in_(count, false) {}

  // Those above 0, in the order of their entry, and their values.
  const std::vector<size_t>& columns() const { return set_; }
  const std::vector<double>& x() const { return x_; }
  const GrowingFactor& factor() const { return factor_; }
  // Or not to be looked at again, as it hardly differs from those that are.
  bool is_in(size_t k) const { return is_in_[k]; }

  // `row`: N's entries for columns() and then for k; b of k. With the value 0.
  void enter(size_t k, std::vector<double> row, double b);
  void enter(const Eigen::MatrixXd& n, const Eigen::VectorXd& b, Eigen::Index k);
  // Another b, by columns().
  void set_right(const std::vector<double>& b) { factor_.set_right(b); }
  // To the minimum over the set, without those that would be negative there.
  void settle();

 private:
  void leave(size_t i);

  std::vector<bool> is_in_;
  std::vector<size_t> set_;
  GrowingFactor factor_;
  std::vector<double> x_;
};

// The minimum, to coefficients that lower it by less than 1e-4. `above`: 0 and those above 0 for another b.
// Coefficients may be so alike that exchanging all that violate their conditions never ends.
Eigen::VectorXd positive_minimum(const Eigen::MatrixXd& n, const Eigen::VectorXd& b, PositiveSet above);

}  // namespace glasswing
