#include "camera-node/backends/aravis/aravis_device.h"

#include <fmt/ranges.h>

#include <algorithm>

#include "core/base/status.h"
#include "core/base/time.h"

namespace glasswing {
namespace {

constexpr nanoseconds kPtpPatience = std::chrono::seconds(20);

struct Found {
  std::string id, model, serial, address;
};

std::string text(const char* c) {
  return c == nullptr ? "" : c;
}

std::vector<Found> all_devices() {
  arv_update_device_list();
  std::vector<Found> found;
  for (unsigned i = 0; i < arv_get_n_devices(); ++i) {
    found.push_back({.id = text(arv_get_device_id(i)),
                     .model = text(arv_get_device_vendor(i)) + " " + text(arv_get_device_model(i)),
                     .serial = text(arv_get_device_serial_nbr(i)),
                     .address = text(arv_get_device_address(i))});
  }
  return found;
}

std::vector<std::string> taken(const char** names, guint count) {
  std::vector<std::string> list;
  for (guint i = 0; names != nullptr && i < count; ++i) list.emplace_back(names[i]);
  g_free(names);
  return list;
}

}  // namespace

absl::StatusOr<std::shared_ptr<AravisDevice>> AravisDevice::open(const std::string& wanted) {
  std::vector<Found> matching;
  std::string list;
  for (const Found& each : all_devices()) {
    list += fmt::format("{}\"{}\" ({}, {})", list.empty() ? "" : ", ", each.id, each.model, each.address);
    const std::string all = each.id + "\n" + each.model + "\n" + each.serial + "\n" + each.address;
    if (each.id != wanted && all.find(wanted) == std::string::npos) continue;
    if (each.id == wanted) matching.clear();
    matching.push_back(each);
    if (each.id == wanted) break;
  }
  if (matching.size() != 1) {
    // The list contains all matching devices, or only an exact match.
    return absl::NotFoundError(
        fmt::format("{}, which fits {} cameras; Aravis sees {}",
                    wanted.empty() ? "no --device is named" : fmt::format("--device is \"{}\"", wanted),
                    matching.size(), list.empty() ? "none" : list));
  }
  const std::string& id = matching.front().id;
  GPtr<ArvCamera> camera;
  GW_RETURN_IF_ERROR(arv_call("let itself be opened (another program may be using it)",
                              [&](GError** error) { camera.reset(arv_camera_new(id.c_str(), error)); }));
  if (camera == nullptr) return absl::UnavailableError(fmt::format("camera \"{}\" cannot be opened", id));
  return std::shared_ptr<AravisDevice>(new AravisDevice(id, std::move(camera)));
}

AravisDevice::AravisDevice(const std::string& id, GPtr<ArvCamera> camera)
    : id_(id), camera_(std::move(camera)) {
  g_signal_connect(arv_camera_get_device(camera_.get()), "control-lost", G_CALLBACK(&note_lost), this);
}

AravisDevice::~AravisDevice() {
  g_signal_handlers_disconnect_by_data(arv_camera_get_device(camera_.get()), this);
}

bool AravisDevice::has(const char* feature) const {
  const absl::StatusOr<gboolean> there = arv_call("list its features", [&](GError** error) -> gboolean {
    return arv_camera_is_feature_available(camera_.get(), feature, error);
  });
  return there.ok() && *there;
}

absl::Status AravisDevice::set_if_there(const char* feature, const char* value) const {
  if (!has(feature)) return absl::OkStatus();
  return arv_call(fmt::format("set {} to {}", feature, value), [&](GError** error) {
    arv_device_set_features_from_string(arv_camera_get_device(camera_.get()),
                                        fmt::format("{}={}", feature, value).c_str(), error);
  });
}

std::vector<std::string> AravisDevice::pixel_formats() const {
  guint count = 0;
  const char** names = arv_camera_dup_available_pixel_formats_as_strings(camera_.get(), &count, nullptr);
  return taken(names, count);
}

std::vector<std::string> AravisDevice::trigger_sources() const {
  guint count = 0;
  const char** names = arv_camera_dup_available_trigger_sources(camera_.get(), &count, nullptr);
  return taken(names, count);
}

absl::Status AravisDevice::enable_chunks() {
  chunks_.clear();
  if (!arv_camera_are_chunks_available(camera_.get(), nullptr)) return absl::OkStatus();
  guint count = 0;
  const char** names = arv_device_dup_available_enumeration_feature_values_as_strings(
      arv_camera_get_device(camera_.get()), "ChunkSelector", &count, nullptr);
  for (const std::string& name : taken(names, count)) {
    if (name == "ExposureTime" || name == "Gain") chunks_.push_back(name);
  }
  return arv_call("send chunks", [&](GError** error) {
    arv_camera_set_chunks(camera_.get(), fmt::format("{}", fmt::join(chunks_, ",")).c_str(), error);
  });
}

absl::Status AravisDevice::enable_ptp() const {
  // The names of the current naming convention, then those of older cameras.
  const bool current = has("PtpEnable");
  if (!current && !has("GevIEEE1588"))
    return absl::FailedPreconditionError(fmt::format("--ptp is given; camera \"{}\" has no PTP", id_));
  GW_RETURN_IF_ERROR(set_if_there(current ? "PtpEnable" : "GevIEEE1588", "true"));
  const char* const feature = current ? "PtpStatus" : "GevIEEE1588Status";
  std::string status;
  for (const nanoseconds until = monotonic_now() + kPtpPatience; monotonic_now() < until;) {
    GW_ASSIGN_OR_RETURN(const char* is, arv_call("tell its PTP status", [&](GError** error) {
                          return arv_camera_get_string(camera_.get(), feature, error);
                        }));
    status = text(is);
    if (status == "Slave") return absl::OkStatus();
    sleep_until_monotonic(monotonic_now() + std::chrono::milliseconds(200));
  }
  return absl::FailedPreconditionError(fmt::format(
      "--ptp is given; camera \"{}\" follows no PTP master in its network: its status is {}", id_, status));
}

}  // namespace glasswing
