// Describes a step in words.
#pragma once

#include <string>
#include <string_view>

#include "core/pattern/plan.h"
#include "glasswing/v1/session.pb.h"

namespace glasswing {

// "back stripe at 45 deg, r 120.0 px, 4 ms"
std::string describe(const Step& step);

// "frame too late"
std::string_view describe(v1::RetakeCause cause);

}  // namespace glasswing
