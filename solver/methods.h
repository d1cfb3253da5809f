// The list of methods. A new method gets its own folder and a line in methods.cpp.
#pragma once

#include <absl/status/statusor.h>

#include <memory>
#include <string>

#include "solver/method/method.h"
#include "solver/method/video_method.h"

namespace glasswing {

// INVALID_ARGUMENT: an unknown method, option or value; the message lists the known ones.
absl::StatusOr<std::unique_ptr<Method>> make_method(const std::string& name, const MethodOptions& options);

// Null if the method solves no videos. INVALID_ARGUMENT: an unknown option, or a value out of range.
absl::StatusOr<std::unique_ptr<VideoMethod>> make_video_method(const std::string& name,
                                                               const MethodOptions& options);

}  // namespace glasswing
