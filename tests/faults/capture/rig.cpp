#include "tests/faults/capture/rig.h"

#include <absl/strings/str_replace.h>
#include <fmt/format.h>

#include <cstdio>
#include <cstdlib>
#include <deque>

#include "camera-node/backends/emission_client.h"
#include "camera-node/services/camera_service.h"
#include "camera-node/services/stage_service.h"
#include "core/archive/archive_service.h"
#include "core/service/registration.h"
#include "core/service/service.h"
#include "display-node/backends/repeating_display.h"
#include "display-node/backends/sim_rail.h"
#include "display-node/services/display_service.h"
#include "display-node/services/emission_service.h"
#include "server/services/session_service.h"
#include "server/services/work_service.h"
#include "tests/faults/capture/delay_relay.h"

namespace glasswing {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr nanoseconds kSoon = seconds(20);

ScreenInfo monitor() {
  return {.name = "back",
          .width_px = FaultyRig::kWidth_px,
          .height_px = FaultyRig::kHeight_px,
          .refresh_hz = FaultyRig::kRefresh_hz,
          .scanout = nanoseconds(std::llround(1e9 / FaultyRig::kRefresh_hz)),
          .lag = milliseconds(3),
          .settle = microseconds(500)};
}

v1::RegisterRequest registered(v1::NodeKind kind, const std::string& name, const std::string& address) {
  v1::RegisterRequest node;
  node.set_kind(kind);
  node.set_name(name);
  node.set_address(address);
  return node;
}

std::string camera_name(size_t index) {
  return fmt::format("camera-{}", index + 1);
}

std::vector<MonitorRail> rails_of(const RigFaults& faults, LightTap& tap) {
  std::vector<MonitorRail> rails;
  if (!faults.rail) return rails;
  rails.push_back({.monitor = "back",
                   .min_mm = 100.0,
                   .max_mm = 300.0,
                   .position_mm = 100.0,
                   .rail = std::make_unique<SimRail>(tap, 0, 100.0, PanelPose())});
  return rails;
}

}  // namespace

struct FaultyRig::ServerNode {
  ServerNode(const std::filesystem::path& data, const RigFaults& faults)
      : server(Server::open({.data = data, .node_call = faults.node_call}).value()),
        sessions(*server),
        nodes(*server),
        work(*server),
        host(ServiceHost::start({}, {&sessions, &nodes, &work}).value()) {}
  ~ServerNode() {
    sessions.stop();
    host->stop(milliseconds(500));
  }
  std::unique_ptr<Server> server;
  SessionServiceImpl sessions;
  NodeServiceImpl nodes;
  WorkServiceImpl work;
  std::unique_ptr<ServiceHost> host;
};

struct FaultyRig::DisplayNode {
  DisplayNode(const RigFaults& faults, std::uint64_t seed, int patch_rows, const std::string& address)
      : sim({monitor()}, faults.display),
        tap(sim),
        display(tap, faults.repeat, seed),
        service("display-1", display, patch_rows, rails_of(faults, tap)),
        emission(tap, {.lag = monitor().lag + faults.light_shift}),
        host(ServiceHost::start({.address = address}, {&service, &emission}).value()) {}
  ~DisplayNode() {
    service.stop();
    emission.stop();
    host->stop(milliseconds(0));
  }
  SimDisplay sim;
  LightTap tap;
  RepeatingDisplay display;
  DisplayServiceImpl service;
  EmissionServiceImpl emission;
  std::unique_ptr<ServiceHost> host;
};

struct FaultyRig::CameraNode {
  CameraNode(const SimCameraOptions& options, std::optional<FolderCamera::Options> tethered,
             const std::filesystem::path& archives, const SpaceOf& space, const std::string& tap,
             const std::string& address)
      : light(tap, timeline),
        camera(SimCamera::create(options, timeline).value()),
        folder(opened(tethered, tap)),
        store(archives, DiskRoom(archives, 0, space)),
        cameras(folder ? static_cast<Camera&>(*folder) : *camera, store),
        archive_service(store),
        stages(*camera),
        host(ServiceHost::start({.address = address, .clock = options.clock},
                                {&cameras, &archive_service, &stages})
                 .value()) {}
  ~CameraNode() {
    cameras.stop();
    host->stop(milliseconds(0));
  }
  static std::unique_ptr<FolderCamera> opened(std::optional<FolderCamera::Options> options,
                                              const std::string& tap) {
    if (!options) return nullptr;
    options->shoot = absl::StrReplaceAll(options->shoot, {{"{tap}", tap}});
    return FolderCamera::open(*options).value();
  }
  EmissionTimeline timeline;
  EmissionClient light;
  std::unique_ptr<SimCamera> camera;     // and the stage
  std::unique_ptr<FolderCamera> folder;  // null: the simulated one
  ArchiveStore store;
  CameraServiceImpl cameras;
  ArchiveServiceImpl archive_service;
  StageServiceImpl stages;
  std::unique_ptr<ServiceHost> host;
};

// Nodes stay registered when they are started again: at the same address, behind the same relay.
struct FaultyRig::Network {
  Network(nanoseconds most, std::uint64_t seed, const std::string& server, const std::string& display_address,
          const std::vector<std::unique_ptr<CameraNode>>& nodes)
      : display_relay(display_address, most, seed),
        display(server, registered(v1::NODE_KIND_DISPLAY, "display-1",
                                   most > nanoseconds(0) ? display_relay.address() : display_address)) {
    for (const auto& node : nodes) {
      const std::string& address = node->host->address();
      camera_relays.emplace_back(address, most, seed + 1000 * (camera_relays.size() + 1));
      cameras.emplace_back(server,
                           registered(v1::NODE_KIND_CAMERA, camera_name(cameras.size()),
                                      most > nanoseconds(0) ? camera_relays.back().address() : address));
    }
  }
  DelayRelay display_relay;
  std::deque<DelayRelay> camera_relays;
  Registration display;
  std::deque<Registration> cameras;
};

FaultyRig::FaultyRig(const RigFaults& faults, std::uint64_t seed, int patch_rows,
                     const std::filesystem::path& data)
    : faults_(faults), seed_(seed), patch_rows_(patch_rows), data_(data) {
  std::filesystem::create_directories(data / "server");
  server_ = std::make_unique<ServerNode>(data / "server", faults);
  restart_display();
  for (size_t i = 0; i <= faults.cameras.size(); ++i) {
    cameras_.push_back(nullptr);
    restart_camera(static_cast<int>(i));
  }
  network_ = std::make_unique<Network>(faults.network_delay, seed, server_->host->address(),
                                       display_->host->address(), cameras_);
  sessions_ = v1::SessionService::NewStub(dial(server_->host->address()));
  const NodeRegistry& rig = server_->server->rig();
  const nanoseconds deadline = monotonic_now() + kSoon;
  while (rig.up(v1::NODE_KIND_CAMERA).size() < cameras_.size() || !rig.displays().ok()) {
    if (monotonic_now() > deadline) {
      std::fputs("the nodes did not register\n", stderr);
      std::abort();
    }
    sleep_until_monotonic(monotonic_now() + milliseconds(10));
  }
}

FaultyRig::~FaultyRig() {
  network_.reset();
  server_.reset();
  cameras_.clear();
  display_.reset();
}

Server& FaultyRig::server() {
  return *server_->server;
}

const std::string& FaultyRig::address() const {
  return server_->host->address();
}

const std::string& FaultyRig::display_address() const {
  return display_->host->address();
}

std::filesystem::path FaultyRig::archives(int camera) const {
  return data_ / (camera == 0 ? "archives" : fmt::format("archives-{}", camera + 1));
}

std::filesystem::path FaultyRig::archive(const std::string& session, int camera) const {
  return archives(camera) / session;
}

void FaultyRig::restart_display() {
  const std::string address = display_ == nullptr ? "127.0.0.1:0" : display_->host->address();
  display_.reset();
  RigFaults faults = faults_;
  faults.display.seed = seed_;
  display_ = std::make_unique<DisplayNode>(faults, seed_, patch_rows_, address);
}

grpc::Status FaultyRig::create(const v1::Plan& plan) {
  v1::CreateSessionRequest request;
  request.set_name("s");
  *request.mutable_plan() = plan;
  v1::CreateSessionResponse created;
  grpc::ClientContext context;
  set_deadline(context, std::chrono::seconds(30));
  return sessions_->CreateSession(&context, request, &created);
}

v1::Session FaultyRig::watch(const std::function<void(const v1::Session&)>& seen) {
  v1::WatchSessionRequest request;
  request.set_name("s");
  grpc::ClientContext context;
  const auto reader = sessions_->WatchSession(&context, request);
  v1::WatchSessionResponse response;
  while (reader->Read(&response)) {
    if (seen) seen(response.session());
  }
  (void)reader->Finish();
  return response.session();
}

void FaultyRig::restart_camera(int camera) {
  std::unique_ptr<CameraNode>& node = cameras_[camera];
  const RigFaults& faults = camera == 0 ? faults_ : faults_.cameras[camera - 1];
  const std::string address = node == nullptr ? "127.0.0.1:0" : node->host->address();
  node.reset();
  std::filesystem::create_directories(archives(camera));
  SimCameraOptions options;
  options.scene = "none";
  options.width_px = kWidth_px;
  options.height_px = kHeight_px;
  options.frame_rate_hz = faults.frame_rate_hz;
  options.sensor.seed = seed_ + 100 * camera;
  if (faults.noiseless) options.sensor.read_sd = options.sensor.gain = 0.0;
  options.sensor.readout = microseconds(300);
  options.sensor.full_scale_exposure_ms = kExposure_ms;
  options.clock = NodeClock(faults.clock_offset, faults.clock_drift_ppm);
  options.drop = faults.drop;
  options.duplicate = faults.duplicate;
  options.late = faults.late;
  options.stamp_jitter = faults.stamp_jitter;
  options.stamp_shift = faults.stamp_shift;
  options.disturbances = faults.disturbances;
  node = std::make_unique<CameraNode>(options, faults.folder, archives(camera), faults.space,
                                      display_->host->address(), address);
  if (!node->timeline.wait_known_until(monotonic_now(), kSoon)) {
    std::fputs("the camera sees no display\n", stderr);
    std::abort();
  }
}

}  // namespace glasswing
