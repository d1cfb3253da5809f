// A GenICam camera (GigE Vision or USB3 Vision) opened by Aravis, and its features with errors as statuses.
// Only the .cpp files of this folder include this header, so that GLib's headers stay out of the rest.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <arv.h>
#include <fmt/format.h>

#include <atomic>
#include <memory>
#include <string>
#include <type_traits>
#include <vector>

namespace glasswing {

struct Unref {
  void operator()(void* object) const { g_object_unref(object); }
};
template <typename T>
using GPtr = std::unique_ptr<T, Unref>;

// Calls `f` with a GError**; its error is UNAVAILABLE. `what`: a description, "set its gain".
template <typename F>
auto arv_call(const std::string& what, const F& f) {
  GError* error = nullptr;
  const auto failure = [&] {
    const absl::Status status =
        absl::UnavailableError(fmt::format("the camera does not {}: {}", what, error->message));
    g_clear_error(&error);
    return status;
  };
  using Result = std::invoke_result_t<F, GError**>;
  if constexpr (std::is_void_v<Result>) {
    f(&error);
    return error == nullptr ? absl::OkStatus() : failure();
  } else {
    const Result result = f(&error);
    return error == nullptr ? absl::StatusOr<Result>(result) : absl::StatusOr<Result>(failure());
  }
}

class AravisDevice {
 public:
  // Opens the only camera whose id, model, serial number or address equals or contains `wanted`. NOT_FOUND
  // lists all cameras. UNAVAILABLE: another program is using it.
  static absl::StatusOr<std::shared_ptr<AravisDevice>> open(const std::string& wanted);
  ~AravisDevice();
  AravisDevice(const AravisDevice&) = delete;
  AravisDevice& operator=(const AravisDevice&) = delete;

  ArvCamera* get() const { return camera_.get(); }
  const std::string& id() const { return id_; }
  bool lost() const { return lost_; }
  bool has(const char* feature) const;
  // Sets a feature if the camera has it.
  absl::Status set_if_there(const char* feature, const char* value) const;
  std::vector<std::string> pixel_formats() const;
  std::vector<std::string> trigger_sources() const;
  // Requests what a frame says of itself, as far as the camera has it.
  absl::Status enable_chunks();
  const std::vector<std::string>& chunks() const { return chunks_; }
  // Lets the camera's clock follow the network's by PTP, and waits until it does. FAILED_PRECONDITION: it has
  // no PTP, or finds no master.
  absl::Status enable_ptp() const;

 private:
  AravisDevice(const std::string& id, GPtr<ArvCamera> camera);
  static void note_lost(ArvDevice*, AravisDevice* device) { device->lost_ = true; }

  const std::string id_;
  const GPtr<ArvCamera> camera_;
  std::vector<std::string> chunks_;
  std::atomic<bool> lost_ = false;
};

}  // namespace glasswing
