// A kind of camera, as a row of the table from which --backend chooses (camera-node/backend_table.cpp).
#pragma once

#include <absl/status/statusor.h>

#include <CLI/CLI.hpp>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "camera-node/camera.h"
#include "core/base/node_clock.h"
#include "core/image/image_file.h"

namespace glasswing {

// The options that several backends share. Empty: not given.
struct CameraSettings {
  std::string name = "camera-1";  // of the node
  std::optional<PictureSize> size;
  std::optional<double> frame_rate_hz;
  std::string format;
  std::optional<double> gain, black_level, readout_ms;
};

struct OpenedCamera {
  std::shared_ptr<Camera> camera;  // may be part of an object that also holds what the camera needs
  Stage* stage = nullptr;          // of a camera that simulates its stage; part of it
  // Of a camera that simulates its stage: turns the object on its table, degrees.
  std::function<void(double degrees)> turn = {};
  NodeClock clock = {};     // of its time stamps
  std::string detail = {};  // beside size and rate, in the list of nodes
};

struct CameraBackend {
  std::string_view name;
  std::vector<std::string_view> shared;  // the options of CameraSettings that it takes
  // Adds its own options to the command line.
  std::function<void(CLI::App&)> add_options;
  // Opens the camera that the parsed options name. INVALID_ARGUMENT: an option does not suit the camera.
  std::function<absl::StatusOr<OpenedCamera>(const CameraSettings&)> open;
};

}  // namespace glasswing
