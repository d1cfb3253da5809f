// When the monitors' light really follows their scan-out, as `glasswing calibrate sync` measured it: one
// file, DATA/calibration/sync.json, that survives the server.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "glasswing/v1/calibration.pb.h"

namespace glasswing {

// Thread-safe.
class SyncStore {
 public:
  // A missing file is an empty store. DATA_LOSS: it cannot be read as what it should be.
  static absl::StatusOr<std::unique_ptr<SyncStore>> open(const std::filesystem::path& data);

  // What was measured last.
  std::optional<v1::MonitorSync> find(const std::string& monitor) const;
  // Durable when it returns OK; replaces what was known of this monitor.
  absl::Status put(const v1::MonitorSync& sync);

 private:
  explicit SyncStore(std::filesystem::path file) : file_(std::move(file)) {}

  const std::filesystem::path file_;
  mutable std::mutex mutex_;
  v1::SyncCalibration calibration_;  // guarded by mutex_
};

}  // namespace glasswing
