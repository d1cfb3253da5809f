// ColourManifold::find, several colours at a time.
#pragma once

#include "solver/ramp/colour_manifold.h"

namespace glasswing::internal {

struct ManifoldTable {
  int row = 0;        // nodes
  float most = 0.0f;  // largest index along a side, just below the last node
  std::array<float, 3> level{}, to_a{}, to_b{};
  std::array<float, 2> from{}, scale{};
  float width_px = 0.0f, height_px = 0.0f;
  // Four numbers a node.
  const float *nodes = nullptr, *held = nullptr, *slopes = nullptr;
};

void find_colours(const ManifoldTable& table, ColourManifold::Colours& colours, size_t count);

}  // namespace glasswing::internal
