#include "server/rig/calibration_store.h"

#include <absl/strings/escaping.h>
#include <fmt/format.h>
#include <google/protobuf/util/json_util.h>

#include <set>

#include "core/base/name.h"
#include "core/base/status.h"
#include "core/file/file.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;
constexpr const char* kSyncFile = "sync.json";

std::string camera_file(const std::string& name) {
  return "camera-" + name + ".json";
}
std::string monitor_file(const std::string& name) {
  return "monitor-" + name + ".json";
}

// DATA_LOSS: damaged; or the system's error.
absl::Status read(const fs::path& file, google::protobuf::Message& message) {
  GW_ASSIGN_OR_RETURN(const std::string json, read_file(file));
  const auto parsed = google::protobuf::util::JsonStringToMessage(json, &message);
  return parsed.ok() ? absl::OkStatus() : absl::DataLossError(std::string(parsed.message()));
}

absl::Status of_another(const std::string& device) {
  return absl::DataLossError(fmt::format("it claims to be for \"{}\"", absl::CHexEscape(device)));
}

absl::Status write(const fs::path& file, const google::protobuf::Message& message) {
  google::protobuf::util::JsonPrintOptions options;
  options.add_whitespace = true;
  options.preserve_proto_field_names = true;
  std::string json;
  const auto printed = google::protobuf::util::MessageToJsonString(message, &json, options);
  if (!printed.ok()) return absl::InvalidArgumentError(std::string(printed.message()));
  return write_file_durably(file, json);
}

template <typename Calibration>
std::vector<Calibration> values_of(const std::map<std::string, Calibration>& map) {
  std::vector<Calibration> values;
  for (const auto& [name, value] : map) values.push_back(value);
  return values;
}

template <typename Calibration>
std::optional<Calibration> found_in(const std::map<std::string, Calibration>& map, const std::string& name) {
  const auto found = map.find(name);
  return found == map.end() ? std::nullopt : std::optional(found->second);
}

}  // namespace

absl::StatusOr<std::unique_ptr<CalibrationStore>> CalibrationStore::open(const fs::path& data,
                                                                         Problems& problems) {
  const fs::path directory = data / "calibration";
  GW_RETURN_IF_ERROR(make_directory_durably(directory));
  std::set<fs::path> files;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(directory, error))
    files.insert(entry.path());
  if (error) return absl::ErrnoToStatus(error.value(), fmt::format("cannot read {}", directory.string()));
  std::unique_ptr<CalibrationStore> store(new CalibrationStore(directory));
  for (const fs::path& file : files) {
    absl::Status taken = store->take(file);
    if (absl::IsDataLoss(taken)) {
      const std::string name = file.filename().string();
      const char* of = name == kSyncFile ? "sync" : name.starts_with("camera-") ? "camera" : "display";
      taken = problems.set_aside(data, file, taken, fmt::format("measure again: glasswing calibrate {}", of));
    }
    if (!taken.ok()) problems.set(file.string(), std::string(taken.message()));
  }
  return store;
}

absl::Status CalibrationStore::take(const fs::path& file) {
  const std::string name = file.filename().string();
  if (name == kSyncFile) {
    v1::SyncCalibration sync;
    GW_RETURN_IF_ERROR(read(file, sync));
    sync_ = std::move(sync);
  } else if (name.starts_with("camera-") && name.ends_with(".json")) {
    v1::CameraCalibration camera;
    GW_RETURN_IF_ERROR(read(file, camera));
    if (name != camera_file(camera.camera())) return of_another(camera.camera());
    cameras_[camera.camera()] = std::move(camera);
  } else if (name.starts_with("monitor-") && name.ends_with(".json")) {
    v1::DisplayCalibration display;
    GW_RETURN_IF_ERROR(read(file, display));
    if (name != monitor_file(display.monitor())) return of_another(display.monitor());
    displays_[display.monitor()] = std::move(display);
  }
  return absl::OkStatus();
}

std::optional<v1::MonitorSync> CalibrationStore::sync(const std::string& monitor) const {
  const std::lock_guard lock(mutex_);
  for (const v1::MonitorSync& sync : sync_.monitors()) {
    if (sync.monitor() == monitor) return sync;
  }
  return std::nullopt;
}

std::optional<v1::CameraCalibration> CalibrationStore::camera(const std::string& name) const {
  const std::lock_guard lock(mutex_);
  return found_in(cameras_, name);
}

std::optional<v1::DisplayCalibration> CalibrationStore::display(const std::string& monitor) const {
  const std::lock_guard lock(mutex_);
  return found_in(displays_, monitor);
}

v1::SyncCalibration CalibrationStore::all_sync() const {
  const std::lock_guard lock(mutex_);
  return sync_;
}

std::vector<v1::CameraCalibration> CalibrationStore::cameras() const {
  const std::lock_guard lock(mutex_);
  return values_of(cameras_);
}

std::vector<v1::DisplayCalibration> CalibrationStore::displays() const {
  const std::lock_guard lock(mutex_);
  return values_of(displays_);
}

absl::Status CalibrationStore::put(const v1::MonitorSync& sync) {
  const std::lock_guard lock(mutex_);
  v1::SyncCalibration changed;
  for (const v1::MonitorSync& other : sync_.monitors()) {
    if (other.monitor() != sync.monitor()) *changed.add_monitors() = other;
  }
  *changed.add_monitors() = sync;
  GW_RETURN_IF_ERROR(write(directory_ / kSyncFile, changed));
  sync_ = std::move(changed);
  return absl::OkStatus();
}

absl::Status CalibrationStore::put(const v1::CameraCalibration& camera) {
  GW_RETURN_IF_ERROR(check_name("camera", camera.camera()));
  const std::lock_guard lock(mutex_);
  GW_RETURN_IF_ERROR(write(directory_ / camera_file(camera.camera()), camera));
  cameras_[camera.camera()] = camera;
  return absl::OkStatus();
}

absl::Status CalibrationStore::put(const v1::DisplayCalibration& display) {
  GW_RETURN_IF_ERROR(check_name("monitor", display.monitor()));
  const std::lock_guard lock(mutex_);
  GW_RETURN_IF_ERROR(write(directory_ / monitor_file(display.monitor()), display));
  displays_[display.monitor()] = display;
  return absl::OkStatus();
}

absl::Status CalibrationStore::forget(const std::string& device) {
  const std::lock_guard lock(mutex_);
  std::vector<fs::path> files;
  if (cameras_.contains(device)) files.push_back(directory_ / camera_file(device));
  if (displays_.contains(device)) files.push_back(directory_ / monitor_file(device));
  if (files.empty()) {
    return absl::NotFoundError(fmt::format(
        "there is no calibration of \"{}\"; glasswing calibrate list shows the existing ones", device));
  }
  for (const fs::path& file : files) {
    std::error_code error;
    fs::remove(file, error);
    if (error) return absl::ErrnoToStatus(error.value(), fmt::format("cannot remove {}", file.string()));
  }
  GW_RETURN_IF_ERROR(flush_directory(directory_));
  cameras_.erase(device);
  displays_.erase(device);
  return absl::OkStatus();
}

}  // namespace glasswing
