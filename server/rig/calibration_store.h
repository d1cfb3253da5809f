// The measured calibrations of the rig's devices, one file each below DATA/calibration:
//
//   sync.json           when the monitors' light follows their scan-out  (glasswing calibrate sync)
//   camera-NAME.json    the light of a camera's codes                    (glasswing calibrate camera)
//   monitor-NAME.json   the light of a monitor's codes                   (glasswing calibrate display)
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "glasswing/v1/calibration.pb.h"
#include "server/storage/problems.h"

namespace glasswing {

// Thread-safe. Keeps the newest calibration of each device; it is durable when put() returns OK.
class CalibrationStore {
 public:
  // Without files the store is empty. A damaged file is set aside, an unreadable one is left; `problems`
  // receives both.
  static absl::StatusOr<std::unique_ptr<CalibrationStore>> open(const std::filesystem::path& data,
                                                                Problems& problems);

  std::optional<v1::MonitorSync> sync(const std::string& monitor) const;
  std::optional<v1::CameraCalibration> camera(const std::string& name) const;
  std::optional<v1::DisplayCalibration> display(const std::string& monitor) const;
  v1::SyncCalibration all_sync() const;
  std::vector<v1::CameraCalibration> cameras() const;
  std::vector<v1::DisplayCalibration> displays() const;

  absl::Status put(const v1::MonitorSync& sync);
  // INVALID_ARGUMENT: the device's name is not a valid name.
  absl::Status put(const v1::CameraCalibration& camera);
  absl::Status put(const v1::DisplayCalibration& display);
  // Removes the light calibration of this camera or monitor; a monitor's sync is kept. NOT_FOUND: it does not
  // exist.
  absl::Status forget(const std::string& device);

 private:
  explicit CalibrationStore(std::filesystem::path directory) : directory_(std::move(directory)) {}
  // Reads a file of the directory, if it is a calibration. DATA_LOSS: damaged.
  absl::Status take(const std::filesystem::path& file);

  const std::filesystem::path directory_;
  mutable std::mutex mutex_;
  v1::SyncCalibration sync_;                                // guarded by mutex_
  std::map<std::string, v1::CameraCalibration> cameras_;    // guarded by mutex_
  std::map<std::string, v1::DisplayCalibration> displays_;  // guarded by mutex_
};

}  // namespace glasswing
