// The rig, steps and archive header that one capture works with.
#pragma once

#include <algorithm>
#include <vector>

#include "core/pattern/plan.h"
#include "glasswing/v1/archive.pb.h"
#include "server/rig/rig_link.h"

namespace glasswing {

struct CaptureSetup {
  RigLinks links;
  std::vector<v1::Monitor> monitors;
  std::vector<Step> steps;     // by number
  v1::CaptureManifest header;  // the archive's as it was created, without frames; empty until it is open

  const Step& step(int number) const { return steps.at(static_cast<size_t>(number)); }
  bool has_patches() const {
    return std::ranges::any_of(monitors, [](const v1::Monitor& monitor) { return monitor.patch_rows() > 0; });
  }
};

}  // namespace glasswing
