// The plans by which the gate's scenes are captured, and the methods that solve them.
#pragma once

#include <map>
#include <string>

#include "solver/method/method.h"

namespace glasswing::gate {

// A plan, and how it is solved.
struct Way {
  std::string method;
  MethodOptions options;
  std::string plan;
};

// By name. Plans as in deploy/plans, for monitors of 64 px.
const std::map<std::string, Way>& ways();

}  // namespace glasswing::gate
