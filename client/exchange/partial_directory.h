// A new archive's directory, under a temporary name until it is complete; removed unless kept.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <filesystem>
#include <memory>

#include "glasswing/v1/archive.pb.h"

namespace glasswing {

class PartialDirectory {
 public:
  // ALREADY_EXISTS: `target` is neither new nor an empty directory.
  static absl::StatusOr<std::unique_ptr<PartialDirectory>> create(std::filesystem::path target);
  ~PartialDirectory();
  PartialDirectory(const PartialDirectory&) = delete;
  PartialDirectory& operator=(const PartialDirectory&) = delete;

  const std::filesystem::path& path() const { return partial_; }  // contains the directory frames/

  // Flushes the frames, writes the manifest, and renames the directory to `target`.
  absl::Status keep(const v1::CaptureManifest& manifest);

 private:
  PartialDirectory(std::filesystem::path target, std::filesystem::path partial)
      : target_(std::move(target)), partial_(std::move(partial)) {}
  const std::filesystem::path target_;
  const std::filesystem::path partial_;
};

}  // namespace glasswing
