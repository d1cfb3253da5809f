#include "server/sync_store.h"

#include <fmt/format.h>
#include <google/protobuf/util/json_util.h>

#include "core/base/file.h"
#include "core/base/status.h"

namespace glasswing {

namespace fs = std::filesystem;

absl::StatusOr<std::unique_ptr<SyncStore>> SyncStore::open(const fs::path& data) {
  const fs::path directory = data / "calibration";
  std::error_code error;
  fs::create_directories(directory, error);
  if (error) return absl::ErrnoToStatus(error.value(), fmt::format("cannot create {}", directory.string()));
  std::unique_ptr<SyncStore> store(new SyncStore(directory / "sync.json"));
  const absl::StatusOr<std::string> json = read_file(store->file_);
  if (absl::IsNotFound(json.status())) return store;
  GW_RETURN_IF_ERROR(json.status());
  const auto parsed = google::protobuf::util::JsonStringToMessage(*json, &store->calibration_);
  if (!parsed.ok()) {
    return absl::DataLossError(fmt::format("{} is damaged: {}; delete it and run: glasswing calibrate sync",
                                           store->file_.string(), std::string(parsed.message())));
  }
  return store;
}

std::optional<v1::MonitorSync> SyncStore::find(const std::string& monitor) const {
  const std::lock_guard lock(mutex_);
  for (const v1::MonitorSync& sync : calibration_.monitors()) {
    if (sync.monitor() == monitor) return sync;
  }
  return std::nullopt;
}

absl::Status SyncStore::put(const v1::MonitorSync& sync) {
  const std::lock_guard lock(mutex_);
  v1::SyncCalibration changed;
  for (const v1::MonitorSync& other : calibration_.monitors()) {
    if (other.monitor() != sync.monitor()) *changed.add_monitors() = other;
  }
  *changed.add_monitors() = sync;
  google::protobuf::util::JsonPrintOptions options;
  options.add_whitespace = true;
  options.preserve_proto_field_names = true;
  std::string json;
  (void)google::protobuf::util::MessageToJsonString(changed, &json,
                                                    options);  // it holds nothing that could fail
  GW_RETURN_IF_ERROR(write_file_durably(file_, json));
  calibration_ = std::move(changed);
  return absl::OkStatus();
}

}  // namespace glasswing
