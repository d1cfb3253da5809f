// Peers that minimise the residuals of our fits: Ceres, its Problems kept from lane to lane so that only data
// and starts change, and ceres::TinySolver.
//
// Model: kParameters; int residual_count() const;
//   void evaluate(const double* p, double* residuals, double* jacobian, ptrdiff_t row, ptrdiff_t column)
//   const;
// dr_i/dp_j goes to jacobian[i row + j column], unless jacobian is null.
#pragma once

#include <benchmark/benchmark.h>
#include <ceres/ceres.h>
#include <ceres/tiny_solver.h>
#include <fmt/format.h>

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tests/bench/rows.h"

namespace glasswing {

// A peer stops at a step that changes chi2 by less than `chi2_gain` of a sample's variance, or that is
// shorter than `step` of the parameters' norm; 0: never.
struct StoppingRule {
  double chi2_gain = 0.0;
  double step = 0.0;
  double noise_sd = 1.0;  // of a sample
};

template <class Model>
using Parameters = Eigen::Matrix<double, Model::kParameters, 1>;

template <class Model>
class CeresPeer {
 public:
  explicit CeresPeer(const StoppingRule& rule) : rule_(rule) {}

  // Nothing if it did not converge.
  std::optional<Parameters<Model>> solve(const Model& model, const Parameters<Model>& start) {
    std::unique_ptr<Kept>& kept = kept_[model.residual_count()];
    if (kept == nullptr) kept = std::make_unique<Kept>(model.residual_count(), rule_);
    kept->cost.model = &model;
    kept->p = start;
    ceres::Solve(kept->options, &kept->problem, &kept->summary);
    if (kept->summary.termination_type != ceres::CONVERGENCE) return std::nullopt;
    return kept->p;
  }

 private:
  struct Cost final : ceres::CostFunction {
    explicit Cost(int residual_count) {
      set_num_residuals(residual_count);
      mutable_parameter_block_sizes()->push_back(Model::kParameters);
    }
    bool Evaluate(double const* const* p, double* residuals, double** jacobians) const override {
      model->evaluate(p[0], residuals, jacobians == nullptr ? nullptr : jacobians[0], Model::kParameters, 1);
      return true;
    }
    const Model* model = nullptr;
  };
  static ceres::Problem::Options borrowing() {
    ceres::Problem::Options options;
    options.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    return options;
  }
  // For one number of residuals, which a Problem cannot change.
  struct Kept {
    Kept(int residual_count, const StoppingRule& rule) : cost(residual_count), problem(borrowing()) {
      problem.AddResidualBlock(&cost, nullptr, p.data());
      options.linear_solver_type = ceres::DENSE_NORMAL_CHOLESKY;
      options.logging_type = ceres::SILENT;
      // Relative to the cost, which is half the variance a residual.
      options.function_tolerance = rule.chi2_gain / residual_count;
      options.parameter_tolerance = rule.step;
    }
    Cost cost;
    Parameters<Model> p;
    ceres::Problem problem;
    ceres::Solver::Options options;
    ceres::Solver::Summary summary;
  };
  StoppingRule rule_;
  std::map<int, std::unique_ptr<Kept>> kept_;
};

template <class Model>
class TinyPeer {
 public:
  explicit TinyPeer(const StoppingRule& rule) {
    solver_.options.function_tolerance = rule.chi2_gain * rule.noise_sd * rule.noise_sd;  // absolute
    solver_.options.parameter_tolerance = rule.step;
  }

  std::optional<Parameters<Model>> solve(const Model& model, const Parameters<Model>& start) {
    Parameters<Model> p = start;
    if (solver_.Solve(Cost{&model}, &p).status == Solver::HIT_MAX_ITERATIONS) return std::nullopt;
    return p;
  }

 private:
  struct Cost {
    using Scalar = double;
    enum { NUM_RESIDUALS = Eigen::Dynamic, NUM_PARAMETERS = Model::kParameters };
    int NumResiduals() const { return model->residual_count(); }
    bool operator()(const double* p, double* residuals, double* jacobian) const {
      model->evaluate(p, residuals, jacobian, 1, model->residual_count());
      return true;
    }
    const Model* model;
  };
  using Solver = ceres::TinySolver<Cost>;
  Solver solver_;
};

// The standard errors at `p`.
template <class Model>
Parameters<Model> standard_errors(const Model& model, const Parameters<Model>& p, double noise_sd) {
  const int n = model.residual_count();
  Eigen::VectorXd residuals(n);
  Eigen::Matrix<double, Eigen::Dynamic, Model::kParameters> jacobian(n, static_cast<int>(Model::kParameters));
  model.evaluate(p.data(), residuals.data(), jacobian.data(), 1, n);
  return noise_sd * (jacobian.transpose() * jacobian).inverse().diagonal().cwiseSqrt();
}

// The peer's answers to all lanes.
template <class Peer, class Model>
std::vector<std::optional<Parameters<Model>>> answers(Peer peer, const std::vector<Model>& models,
                                                      const std::vector<Parameters<Model>>& starts) {
  std::vector<std::optional<Parameters<Model>>> found;
  for (std::size_t i = 0; i < models.size(); ++i) found.push_back(peer.solve(models[i], starts[i]));
  return found;
}

// Two solvers' answers to the same lanes. A lane counts if both settled and no parameter differs by more than
// a tenth of its standard error.
struct Comparison {
  std::vector<std::size_t> equal;  // lanes
  int lanes = 0, ours_unsettled = 0, theirs_unsettled = 0, different = 0;
  double equal_share() const { return static_cast<double>(equal.size()) / lanes; }
};

template <class Answer>
Comparison compared(const std::vector<std::optional<Answer>>& ours,
                    const std::vector<std::optional<Answer>>& theirs, const std::vector<Answer>& sd) {
  Comparison result;
  result.lanes = static_cast<int>(ours.size());
  for (std::size_t i = 0; i < ours.size(); ++i) {
    if (!ours[i]) {
      ++result.ours_unsettled;
    } else if (!theirs[i]) {
      ++result.theirs_unsettled;
    } else if (!((*ours[i] - *theirs[i]).cwiseAbs().array() <= 0.1 * sd[i].array()).all()) {
      ++result.different;
    } else {
      result.equal.push_back(i);
    }
  }
  return result;
}

// Times the peer on the lanes that count, one after another.
template <class Peer, class Model>
void run_peer(benchmark::State& state, Peer peer, const std::vector<Model>& models,
              const std::vector<Parameters<Model>>& starts, const Comparison& comparison) {
  std::size_t fits = 0;
  for (auto _ : state) {
    const std::size_t lane = comparison.equal[fits++ % comparison.equal.size()];
    benchmark::DoNotOptimize(peer.solve(models[lane], starts[lane]));
  }
  state.SetItemsProcessed(static_cast<std::int64_t>(fits));
}

// The row of our rate over the peer's, both of lanes that count, and that of the lanes that do not. We pay
// for all lanes, the peer only for those that count.
inline void add_peer_rows(std::vector<Row>& rows, const std::string& figure, const std::string& peer_name,
                          const std::string& ours, const std::string& peer,
                          const std::function<const Comparison&()>& comparison) {
  rows.push_back({figure + ": fits/s over " + peer_name, "x", {ours, peer}, [=](const Rates& rates) {
                    return rates.at(ours) * comparison().equal_share() / rates.at(peer);
                  }});
  rows.push_back({figure + ": left out beside " + peer_name, "% of fits", {}, [=](const Rates&) {
                    const Comparison& all = comparison();
                    fmt::print("{} and {}, of {} fits: ours unsettled {}, theirs {}, different {}\n", figure,
                               peer_name, all.lanes, all.ours_unsettled, all.theirs_unsettled, all.different);
                    return 100.0 * (1.0 - all.equal_share());
                  }});
}

}  // namespace glasswing
