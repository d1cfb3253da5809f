// An archive's directory, under a name of its own until it is whole; what is not kept is removed.
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

  const std::filesystem::path& path() const { return partial_; }  // it has a directory frames/

  // Flushes the frames, writes the manifest, and gives the directory its name.
  absl::Status keep(const v1::CaptureManifest& manifest);

 private:
  PartialDirectory(std::filesystem::path target, std::filesystem::path partial)
      : target_(std::move(target)), partial_(std::move(partial)) {}
  const std::filesystem::path target_;
  const std::filesystem::path partial_;
};

}  // namespace glasswing
