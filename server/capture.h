// One capture, from the first step without proof to the sealed archive. Loads programs into the displays,
// lets the camera run, listens to both, proves, and has the camera keep what is proven. No RPC stands between
// one step and the next.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <stop_token>
#include <string>
#include <vector>

#include "core/clock/clock_model.h"
#include "core/pattern/plan.h"
#include "glasswing/v1/archive_service.grpc.pb.h"
#include "glasswing/v1/camera_service.grpc.pb.h"
#include "glasswing/v1/clock_service.grpc.pb.h"
#include "glasswing/v1/display_service.grpc.pb.h"
#include "glasswing/v1/session_service.pb.h"
#include "glasswing/v1/stage_service.grpc.pb.h"
#include "server/proof.h"
#include "server/rig.h"

namespace glasswing {

struct CaptureOutcome {
  enum class Kind {
    kCaptured,
    kStopped,        // asked to
    kNodeLost,       // a node went away; going on later loses nothing
    kNeedsOperator,  // a person has to move the object, then resume
    kFailed,
  };
  Kind kind = Kind::kFailed;
  std::string reason;
};

// A node and how its clock relates to ours. Rig time is the server's CLOCK_MONOTONIC, which no setting of
// wall clocks moves. Times may be asked for from any thread.
class NodeLink {
 public:
  explicit NodeLink(const v1::Node& node);
  // "camera node \"camera-1\" at 127.0.0.1:7442"
  const std::string& title() const { return title_; }
  const std::shared_ptr<grpc::Channel>& channel() const { return channel_; }
  absl::Status exchange_clocks(int count);
  ClockReading rig_from_node(nanoseconds node_time) const;
  ClockReading node_from_rig(nanoseconds rig_time) const;

 private:
  std::string title_;
  std::shared_ptr<grpc::Channel> channel_;
  std::unique_ptr<v1::ClockService::Stub> stub_;
  mutable std::mutex mutex_;
  ClockModel clock_;
};

// The monitors and the camera that are there now.
struct RigDescription {
  std::vector<v1::Monitor> monitors;
  v1::GetCameraResponse camera;
};
absl::StatusOr<RigDescription> describe_rig(const Rig& rig);

class Capture {
 public:
  // `images` holds what UploadImage stored. `object_confirmed`: a person has said that the object is (not) on
  // the stage. `report` is called with the counts brought up to date, from the thread that calls run().
  Capture(const Rig& rig, std::filesystem::path images, v1::Session session,
          std::optional<bool> object_confirmed, std::function<void(const v1::Session&)> report);
  ~Capture();

  CaptureOutcome run(std::stop_token stop);

 private:
  struct Display;
  struct Group {
    bool object;
    double exposure_ms;
    std::vector<Step> steps;
  };
  class CameraFeed;
  class DisplayFeed;

  absl::Status connect();
  absl::Status open_archive();
  absl::Status send_images();
  // False: a person has to move it.
  absl::StatusOr<bool> move_object(bool present);
  absl::Status take(const Group& group, std::stop_token stop);
  absl::Status play(const std::vector<Step>& steps, CameraFeed& frames, std::stop_token stop);
  absl::Status keep(const std::vector<FrameMatcher::Match>& matches, CameraFeed& frames);
  absl::Status seal();

  const Rig& rig_;
  const std::filesystem::path images_;
  v1::Session session_;
  const std::optional<bool> object_confirmed_;
  const std::function<void(const v1::Session&)> report_;

  std::vector<std::unique_ptr<Display>> displays_;
  std::unique_ptr<NodeLink> camera_;
  std::unique_ptr<v1::CameraService::Stub> camera_stub_;
  std::unique_ptr<v1::ArchiveService::Stub> archive_stub_;
  std::unique_ptr<v1::StageService::Stub> stage_stub_;
  v1::GetCameraResponse camera_info_;
  std::vector<v1::Monitor> monitors_;
  std::vector<Step> steps_;
  std::set<int> proven_;
  int program_number_ = 0;
};

}  // namespace glasswing
