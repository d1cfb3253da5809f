// A rig in one process, every daemon behind gRPC on loopback, with whatever is wrong with it.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "camera-node/backends/folder_camera.h"
#include "camera-node/backends/sim_camera.h"
#include "core/archive/disk_room.h"
#include "core/sim/disturbances.h"
#include "display-node/backends/sim_display.h"
#include "glasswing/v1/session_service.grpc.pb.h"
#include "server/services/server.h"

namespace glasswing {

struct RigFaults {
  std::string name;
  SimDisplay::Faults display = {};
  double repeat = 0.0;        // RepeatingDisplay
  nanoseconds light_shift{};  // of the monitor's lag, not declared
  double drop = 0.0, duplicate = 0.0;
  nanoseconds late{}, stamp_jitter{}, stamp_shift{};  // SimCameraOptions
  nanoseconds clock_offset{};                         // of the camera node
  double clock_drift_ppm = 0.0;
  double frame_rate_hz = 1000.0;
  nanoseconds network_delay{};                           // at most, each way between the server and the nodes
  Disturbances disturbances = {};                        // of the camera
  bool restart_camera = false, restart_display = false;  // in mid-session
  SpaceOf space = space_of;                              // of the camera node's disk
  std::chrono::milliseconds node_call = kNodeCall;       // ServerOptions
  bool rail = false;  // of the monitor, from 100 to 300 mm, where it is at 100
  // A camera whose pictures come into a folder, in place of the simulated one; in its command {tap} becomes
  // the address of the display's light.
  std::optional<FolderCamera::Options> folder = {};
  bool noiseless = false;  // frames of one picture are equal
  std::vector<RigFaults> cameras =
      {};  // beside the first, "camera-1": "camera-2" and so on, with these faults of theirs
};

class FaultyRig {
 public:
  static constexpr int kWidth_px = 192, kHeight_px = 144;  // of the monitor "back" and of the camera
  static constexpr double kRefresh_hz = 240.0, kExposure_ms = 0.5;
  static constexpr double kMaxNoise = 0.0035;  // sd of a full-scale sample

  // Returns when all know of each other.
  FaultyRig(const RigFaults& faults, std::uint64_t seed, int patch_rows, const std::filesystem::path& data);
  ~FaultyRig();

  v1::SessionService::Stub& sessions() { return *sessions_; }
  // Session "s". watch() returns it once it rests, and calls `seen` with every change.
  grpc::Status create(const v1::Plan& plan);
  v1::Session watch(const std::function<void(const v1::Session&)>& seen = nullptr);
  Server& server();
  const std::string& address() const;  // of the server
  const std::string& display_address() const;
  // `camera`: 0 for the first.
  std::filesystem::path archive(const std::string& session, int camera = 0) const;
  void restart_camera(int camera = 0);
  void restart_display();

 private:
  struct ServerNode;
  struct DisplayNode;
  struct CameraNode;
  struct Network;

  std::filesystem::path archives(int camera) const;

  const RigFaults faults_;
  const std::uint64_t seed_;
  const int patch_rows_;
  const std::filesystem::path data_;
  std::unique_ptr<ServerNode> server_;
  std::unique_ptr<DisplayNode> display_;
  std::vector<std::unique_ptr<CameraNode>> cameras_;
  std::unique_ptr<Network> network_;
  std::unique_ptr<v1::SessionService::Stub> sessions_;
};

}  // namespace glasswing
