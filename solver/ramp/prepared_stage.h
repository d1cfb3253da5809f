// What RampExtractor keeps between frames.
#pragma once

#include "glasswing/v1/matte.pb.h"
#include "solver/background/mask_cleaning.h"
#include "solver/ramp/ramp_extractor.h"
#include "solver/ramp/ramp_stage.h"

namespace glasswing {

struct RampExtractor::Prepared {
  RampStage stage;
  RampOptions options;
  MaskCleaning cleaning;
  int highlight_reach_px = 1;
  v1::MatteMetadata metadata;
};

}  // namespace glasswing
