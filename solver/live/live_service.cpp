#include "solver/live/live_service.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <condition_variable>
#include <mutex>
#include <optional>
#include <thread>

#include "core/base/status.h"
#include "core/image/image_file.h"
#include "core/service/service.h"
#include "solver/live/live_matte.h"
#include "solver/ramp/ramp_compositor.h"

namespace glasswing {
namespace {

using std::chrono::milliseconds;
constexpr size_t kEmptyFrames = 16;
constexpr size_t kMaxPictureBytes = size_t{64} << 20;
constexpr milliseconds kPoll(50);  // how soon a departed caller is noticed
// How long to wait for a call that was just cancelled to release the solver.
constexpr std::chrono::seconds kGrace(1);
// How long frames may be rejected, for example while a hand is in the picture.
constexpr std::chrono::seconds kPatience(5);

double ms_since(nanoseconds then) {
  return 1e-6 * static_cast<double>((monotonic_now() - then).count());
}

void count_pixels(const RampFrame& matte, v1::LiveFrame& live) {
  std::int64_t object = 0, flagged = 0;
  for (size_t i = 0; i < matte.alpha.size(); ++i) {
    object += matte.alpha[i] > 0.0f;
    flagged += matte.alpha[i] > 0.0f && matte.flags[i] != kFlagNone;
  }
  live.set_object_pixel_count(object);
  live.set_flagged_pixel_count(flagged);
}

}  // namespace

// Reads on gRPC's threads and works on its own thread, which ends with Finish(); the call then deletes
// itself.
class LiveServiceImpl::Call final : public grpc::ServerBidiReactor<v1::RunLiveRequest, v1::RunLiveResponse> {
 public:
  explicit Call(LiveServiceImpl& service) : service_(service) {
    StartRead(&request_);
    std::thread([this] { finish(work()); }).detach();
  }

  void OnReadDone(bool ok) override {
    {
      const std::lock_guard lock(mutex_);
      if (ok) take(request_);
      closed_ = closed_ || !ok;
    }
    changed_.notify_all();
    if (ok) StartRead(&request_);
  }
  void OnWriteDone(bool ok) override {
    const std::lock_guard lock(mutex_);
    writing_ = false;
    gone_ = gone_ || !ok;
    changed_.notify_all();
  }
  void OnCancel() override {
    const std::lock_guard lock(mutex_);
    gone_ = true;
    changed_.notify_all();
  }
  void OnDone() override { delete this; }

 private:
  // The functions below require mutex_.
  void take(v1::RunLiveRequest& request) {
    if (!start_) {
      start_ = std::move(*request.mutable_start());
      return;
    }
    if (picture_.size() + request.picture().size() > kMaxPictureBytes) too_large_ = true;
    if (!too_large_) picture_ += request.picture();
    if (!request.picture_ends()) return;
    whole_picture_ = std::exchange(picture_, {});
  }

  bool ended() {
    const std::lock_guard lock(mutex_);
    return gone_ || service_.stopping_;
  }
  // Waits until the previous response has been sent.
  void write(v1::RunLiveResponse response) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return !writing_ || gone_; });
    if (gone_) return;
    response_ = std::move(response);
    writing_ = true;
    StartWrite(&response_);
  }
  void finish(const absl::Status& status) {
    if (!status.ok()) spdlog::warn("live mattes ended: {}", std::string(status.message()));
    {
      std::unique_lock lock(mutex_);
      changed_.wait(lock, [this] { return !writing_; });
    }
    Finish(to_grpc(status));
  }

  absl::StatusOr<v1::LiveStart> wait_start() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return start_ || closed_ || gone_; });
    if (!start_ || start_->camera_address().empty())
      return absl::InvalidArgumentError("the first request must have a start");
    return *start_;
  }

  // The functions below run on the worker.
  absl::Status work() {
    const std::unique_lock only(service_.working_, kGrace);
    if (!only.owns_lock()) {
      return absl::ResourceExhaustedError("this solver is busy with another live call; try again later");
    }
    GW_ASSIGN_OR_RETURN(const v1::LiveStart start, wait_start());
    GW_RETURN_IF_ERROR(LiveMatte::check_options(start));
    CameraStream camera(start.camera_address(), start.exposure_ms());
    GW_ASSIGN_OR_RETURN(const v1::Camera described, camera.describe());
    std::vector<StreamedFrame> empties;
    while (empties.size() < kEmptyFrames && !ended()) {
      GW_ASSIGN_OR_RETURN(std::optional<StreamedFrame> frame, camera.newest(kPoll));
      if (!frame) continue;
      if (empties.empty()) spdlog::info("live mattes of {}", start.camera_address());
      empties.push_back(*std::move(frame));
      v1::RunLiveResponse response;
      response.set_empty_frames_left(static_cast<int>(kEmptyFrames - empties.size()));
      if (empties.size() < kEmptyFrames) write(std::move(response));
    }
    if (ended()) return end_status();
    GW_ASSIGN_OR_RETURN(LiveMatte mattes,
                        LiveMatte::create(start, described, empties, service_.thread_count_));
    write(v1::RunLiveResponse());
    std::jthread preparing(
        [&](std::stop_token stop) { prepare_backgrounds(start.monitor(), mattes.empty_stage(), stop); });
    return run(camera, mattes);
  }

  absl::Status run(CameraStream& camera, LiveMatte& mattes) {
    std::int64_t first = -1, made = 0;
    nanoseconds accepted = monotonic_now();
    while (!ended()) {
      GW_ASSIGN_OR_RETURN(const std::optional<StreamedFrame> frame, camera.newest(kPoll));
      std::shared_ptr<const RampBackground> background;
      {
        const std::lock_guard lock(mutex_);
        GW_RETURN_IF_ERROR(background_error_);
        background = background_;
      }
      if (!frame || background == nullptr) continue;
      if (first < 0) first = frame->taken.sequence();
      const absl::StatusOr<RampFrame> matte = mattes.next(*frame);
      if (!matte.ok()) {
        if (monotonic_now() - accepted > kPatience) return matte.status();
        continue;
      }
      accepted = monotonic_now();
      ++made;
      v1::RunLiveResponse response;
      v1::LiveFrame& live = *response.mutable_frame();
      *live.mutable_taken() = frame->taken;
      live.set_frames_passed_over(frame->taken.sequence() - first + 1 - made);
      count_pixels(*matte, live);
      const std::vector<std::uint8_t> picture = composite(*matte, *background, service_.thread_count_);
      live.set_solve_ms(ms_since(frame->came));
      write_picture(picture, std::move(response));
    }
    return end_status();
  }

  void write_picture(const std::vector<std::uint8_t>& picture, v1::RunLiveResponse response) {
    const char* const bytes = reinterpret_cast<const char*>(picture.data());
    for (size_t at = 0; at < picture.size(); at += kChunkBytes) {
      response.mutable_frame()->set_picture(bytes + at, std::min(kChunkBytes, picture.size() - at));
      write(std::move(response));
      response.Clear();
    }
  }

  // Decoded in parallel, so that no frame waits for a picture.
  void prepare_backgrounds(const v1::Monitor& monitor, const Matte& empty_stage, std::stop_token stop) {
    while (!stop.stop_requested()) {
      std::string bytes;
      {
        std::unique_lock lock(mutex_);
        changed_.wait_for(lock, kPoll, [this] { return whole_picture_ || too_large_; });
        if (too_large_)
          background_error_ = absl::InvalidArgumentError(
              fmt::format("the background's file is larger than {} bytes", kMaxPictureBytes));
        if (!whole_picture_) continue;
        bytes = *std::exchange(whole_picture_, std::nullopt);
      }
      const absl::StatusOr<RadianceImage> picture = decode_radiance(bytes, Encoding::kDisplay);
      std::shared_ptr<const RampBackground> made;
      if (picture.ok()) {
        made = std::make_shared<const RampBackground>(
            resized(*picture, monitor.width_px(), monitor.height_px()), empty_stage, 1);
      }
      const std::lock_guard lock(mutex_);
      if (picture.ok()) background_ = std::move(made);
      if (!picture.ok())
        background_error_ = absl::InvalidArgumentError("the background cannot be read: " +
                                                       std::string(picture.status().message()));
    }
  }

  absl::Status end_status() const {
    return service_.stopping_ ? absl::UnavailableError("the solver is stopping") : absl::OkStatus();
  }

  LiveServiceImpl& service_;
  v1::RunLiveRequest request_;
  v1::RunLiveResponse response_;
  std::mutex mutex_;
  std::condition_variable changed_;
  // Guarded by mutex_.
  std::optional<v1::LiveStart> start_;
  std::string picture_;  // as far as received
  std::optional<std::string> whole_picture_;
  bool too_large_ = false;
  std::shared_ptr<const RampBackground> background_;
  absl::Status background_error_;
  bool closed_ = false, gone_ = false, writing_ = false;
};

grpc::ServerBidiReactor<v1::RunLiveRequest, v1::RunLiveResponse>* LiveServiceImpl::RunLive(
    grpc::CallbackServerContext*) {
  return new Call(*this);
}

}  // namespace glasswing
