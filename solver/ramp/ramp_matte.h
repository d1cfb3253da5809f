// The matte of a ramp frame: one box of the ramp's light and one of the background for each pixel.
#pragma once

#include "core/matte/matte.h"
#include "solver/ramp/ramp_stage.h"
#include "solver/ramp/smoother/ramp_frame.h"

namespace glasswing {

// RampExtractor::matte().
Matte matte_of(const RampStage& stage, const v1::MatteMetadata& metadata, const RampFrame& frame,
               int thread_count);

}  // namespace glasswing
