// The server's links to the rig's nodes: channels, clocks and descriptions.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include "core/timing/clock_model.h"
#include "glasswing/v1/camera_service.grpc.pb.h"
#include "glasswing/v1/clock_service.grpc.pb.h"
#include "glasswing/v1/display_service.grpc.pb.h"
#include "glasswing/v1/plan.pb.h"
#include "server/rig/calibration_store.h"
#include "server/rig/node_registry.h"

namespace glasswing {

// A node and the relation of its clock to ours. Rig time is the server's CLOCK_MONOTONIC, which is not
// affected by setting the wall clock. Times may be converted on any thread.
class NodeLink {
 public:
  explicit NodeLink(const v1::Node& node, std::chrono::milliseconds call_time = kNodeCall);
  // "camera node \"camera-1\" at 127.0.0.1:7442"
  const std::string& title() const { return title_; }
  const std::string& address() const { return address_; }
  const std::shared_ptr<grpc::Channel>& channel() const { return channel_; }
  // DEADLINE_EXCEEDED: the node does not answer `within` this time.
  // CANCELLED: stopped.
  absl::Status exchange_clocks(int count, std::chrono::milliseconds within = std::chrono::seconds(2),
                               std::stop_token stop = {});
  // Repeats a call until the node answers it. A call that takes longer than the call time is repeated, with
  // twice the time, as long as the node answers its clock: it is slow, not lost. For calls that change
  // something, `make` uses the same request_id each time. `what`: a description such as "store frames".
  // DEADLINE_EXCEEDED: the node does not answer its clock either. CANCELLED: stopped.
  absl::Status call(const std::string& what, std::stop_token stop,
                    const std::function<grpc::Status(grpc::ClientContext&)>& make);
  // The same for a call in progress: waits for `answered`. DEADLINE_EXCEEDED as in call().
  absl::Status wait(const std::string& what, std::stop_token stop,
                    const std::function<bool(std::chrono::milliseconds)>& answered);
  // Calls `note` with the slow node and the operation, once a call has taken the call time, and with "" once
  // answered.
  void note_slow_calls(std::function<void(const std::string&)> note) { note_slow_ = std::move(note); }
  ClockReading rig_from_node(nanoseconds node_time) const;
  ClockReading node_from_rig(nanoseconds rig_time) const;

 private:
  std::string title_, address_;
  std::shared_ptr<grpc::Channel> channel_;
  // Has its own connection: behind the camera's stream of frames an exchange would be delayed in one
  // direction, which biases the offset.
  std::unique_ptr<v1::ClockService::Stub> stub_;
  const std::chrono::milliseconds call_time_;
  std::function<void(const std::string&)> note_slow_;
  mutable std::mutex mutex_;
  ClockModel clock_;
};

struct DisplayLink {
  explicit DisplayLink(const v1::Node& node, std::chrono::milliseconds call_time = kNodeCall);
  // Fetches `info`.
  absl::Status describe(std::stop_token stop);
  // Copies measured lag and settling into `sync`.
  void use(const CalibrationStore& store);
  // Errors are those of DisplayService.MoveMonitor. CANCELLED: stopped, and the rail is at rest.
  absl::StatusOr<double> move_monitor(const std::string& name, double position_mm, std::stop_token stop);
  // Null: the display has no monitor of that name.
  const v1::DisplayMonitor* monitor(const std::string& name) const;

  NodeLink link;
  std::unique_ptr<v1::DisplayService::Stub> stub;
  v1::GetDisplayResponse info;
  std::map<std::string, v1::MonitorSync> sync;  // by monitor; one without uses the times that `info` declares
};

// Links to every display that answers, and the camera.
struct RigLinks {
  std::vector<std::shared_ptr<DisplayLink>> displays;  // shared by the cameras of a capture
  std::vector<std::string> silent_displays;            // titles of those that do not answer
  std::unique_ptr<NodeLink> camera;
  std::unique_ptr<v1::CameraService::Stub> camera_stub;
  v1::GetCameraResponse camera_info;

  absl::Status exchange_clocks(int count, const std::stop_token& stop = {});
  void note_slow_calls(const std::function<void(const std::string&)>& note);
  // FAILED_PRECONDITION: two monitors have the same name.
  absl::StatusOr<std::vector<v1::Monitor>> monitors() const;
};
// Monitors by name; empty: all of the rig.
using MonitorNames = std::vector<std::string>;
// "back, left"
std::string names_of(const std::vector<v1::Monitor>& monitors);
// INVALID_ARGUMENT: `name` is none of these.
absl::Status no_monitor(const std::string& name, const std::vector<v1::Monitor>& monitors);
// The same, for the first name that is none of these.
absl::Status check_monitors(const MonitorNames& names, const std::vector<v1::Monitor>& monitors);
MonitorNames monitors_of(const v1::Plan& plan);
// `camera`: as for NodeRegistry::camera(), whose errors are returned. UNAVAILABLE: the camera, or a display
// that may have one of the monitors, does not answer. CANCELLED: stopped.
absl::StatusOr<RigLinks> connect(const NodeRegistry& rig, const CalibrationStore& calibrations,
                                 const std::string& camera, const MonitorNames& monitors,
                                 std::stop_token stop = {});
// Adds the camera to links without one.
absl::Status connect_camera(const NodeRegistry& rig, const std::string& camera, RigLinks& links,
                            std::stop_token stop = {});
// The same as connect() without a camera.
absl::StatusOr<RigLinks> connect_displays(const NodeRegistry& rig, const CalibrationStore& calibrations,
                                          const MonitorNames& monitors, std::stop_token stop = {});

}  // namespace glasswing
