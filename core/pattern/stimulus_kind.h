// The kinds of stimulus and their names in plans and archives (stimulus.proto). No other code compares these
// names.
#pragma once

#include <string_view>

#include "glasswing/v1/stimulus.pb.h"

namespace glasswing {

enum class StimulusKind {
  kUnknown,  // not a name known to this program
  kSolid,
  kStripe,
  kSinusoid,
  kSquare,
  kRamp,
  kPhoto,
  kPatch,
};

StimulusKind kind_of(const v1::Stimulus& stimulus);

// The name as in Stimulus.kind; empty for kUnknown.
std::string_view name_of(StimulusKind kind);

}  // namespace glasswing
