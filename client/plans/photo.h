// The comparison pictures of a plan.
#pragma once

#include <filesystem>

#include "glasswing/v1/plan.pb.h"

namespace glasswing {

// `Photo.file` is relative to the plan.
inline std::filesystem::path photo_path(const std::filesystem::path& plan, const v1::Photo& photo) {
  return plan.parent_path() / photo.file();
}

// The name of the photo's frame in the archive.
inline std::string photo_name(const v1::Photo& photo) {
  return photo.name().empty() ? std::filesystem::path(photo.file()).stem().string() : photo.name();
}

}  // namespace glasswing
