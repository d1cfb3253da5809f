// How the modules that use Ceres solve their fits of some hundred parameters.
#pragma once

#include <ceres/ceres.h>

namespace glasswing {

// Returns whether the fit converged.
inline bool solve_least_squares(ceres::Problem& problem) {
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
  options.max_num_iterations = 50;
  options.function_tolerance = 1e-10;
  options.parameter_tolerance = 1e-10;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  return summary.termination_type == ceres::CONVERGENCE;
}

}  // namespace glasswing
