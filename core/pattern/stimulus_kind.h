// The kinds of stimulus, by the names that plans and archives give them (stimulus.proto). The only place that
// knows these names.
#pragma once

#include <string_view>

#include "glasswing/v1/stimulus.pb.h"

namespace glasswing {

enum class StimulusKind {
  kUnknown,  // a name that this program does not have
  kSolid,
  kStripe,
  kSinusoid,
  kSquare,
  kRamp,
  kPhoto,
  kPatch,
};

StimulusKind kind_of(const v1::Stimulus& stimulus);

// As Stimulus.kind; empty for kUnknown.
std::string_view name_of(StimulusKind kind);

}  // namespace glasswing
