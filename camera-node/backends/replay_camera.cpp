#include "camera-node/backends/replay_camera.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "core/base/checksum.h"
#include "core/base/status.h"
#include "core/file/file.h"
#include "core/frame/archive.h"
#include "core/image/image_file.h"
#include "core/import/foreign_manifest.h"

namespace glasswing {
namespace {

constexpr double kUsualRate_hz = 30.0;
constexpr nanoseconds kLongestPause = std::chrono::seconds(1);
constexpr nanoseconds kUncertainty = std::chrono::microseconds(1);

size_t frame_bytes(const FrameShape& shape) {
  return 2 * shape.row_samples() * static_cast<size_t>(shape.height_px);
}

bool same_exposure(double held_ms, double asked_ms) {
  return std::abs(held_ms - asked_ms) <= 0.01 * held_ms;
}

nanoseconds exposure_of(const v1::Frame& frame) {
  return nanoseconds(std::llround(frame.exposure_ms() * 1e6));
}

absl::StatusOr<v1::CaptureManifest> read_manifest(const std::filesystem::path& directory) {
  if (!std::filesystem::exists(directory / "header.json")) return read_any_manifest(directory);
  GW_ASSIGN_OR_RETURN(const std::unique_ptr<Archive> archive, Archive::open(directory));
  return archive->manifest();
}

absl::StatusOr<Image16> read_picture(const std::filesystem::path& path, const v1::Frame& frame,
                                     const v1::Camera& camera) {
  // Only archives of our own format have checksums.
  if (frame.checksum().empty()) return read_frame_file(path, shape_of(camera));
  GW_ASSIGN_OR_RETURN(const std::string bytes, read_file(path));
  const auto damaged = [&path](const std::string& how) {
    return absl::DataLossError(fmt::format("{} is damaged: {}", path.string(), how));
  };
  if (checksum_of(bytes) != frame.checksum())
    return damaged(fmt::format("its checksum is {} instead of {}", checksum_of(bytes), frame.checksum()));
  if (const absl::Status head = check_tiff_head(bytes, bytes.size(), shape_of(camera)); !head.ok())
    return damaged(std::string(head.message()));
  absl::StatusOr<Image16> image = decode_tiff(bytes);
  if (!image.ok()) return damaged(std::string(image.status().message()));
  return image;
}

}  // namespace

absl::StatusOr<std::unique_ptr<ReplayCamera>> ReplayCamera::open(const Options& options) {
  GW_ASSIGN_OR_RETURN(const v1::CaptureManifest manifest, read_manifest(options.archive));
  std::vector<Replayed> frames;
  for (const v1::Frame& frame : manifest.frames()) {
    if (!(frame.exposure_ms() > 0.0)) continue;  // unknown in some foreign archives
    const nanoseconds recorded(frame.exposure_end_ns() - frame.exposure_start_ns());
    frames.push_back({.frame = frame, .length = std::max(recorded, exposure_of(frame))});
  }
  if (frames.empty()) {
    return absl::FailedPreconditionError(
        fmt::format("{} contains no frame whose exposure_ms is known; there is nothing to replay",
                    options.archive.string()));
  }
  const nanoseconds usual(std::llround(1e9 / options.frame_rate_hz.value_or(kUsualRate_hz)));
  for (size_t i = 0; i < frames.size(); ++i) {
    const nanoseconds recorded(i + 1 < frames.size() ? frames[i + 1].frame.exposure_start_ns() -
                                                           frames[i].frame.exposure_start_ns()
                                                     : 0);
    const bool own = !options.frame_rate_hz && recorded >= frames[i].length && recorded <= kLongestPause;
    frames[i].interval = own ? recorded : usual;
    if (frames[i].interval < frames[i].length) {
      return absl::FailedPreconditionError(fmt::format(
          "{} was exposed for {:.6g} ms, first row to last; it does not fit into the {:.6g} ms of "
          "a frame: give a smaller --fps",
          frames[i].frame.file(), static_cast<double>(frames[i].length.count()) / 1e6,
          static_cast<double>(frames[i].interval.count()) / 1e6));
    }
  }
  return std::unique_ptr<ReplayCamera>(new ReplayCamera(options, manifest.camera(), std::move(frames)));
}

ReplayCamera::ReplayCamera(const Options& options, const v1::Camera& camera, std::vector<Replayed> frames)
    : options_(options), camera_(camera), frames_(std::move(frames)) {}

v1::GetCameraResponse ReplayCamera::describe() const {
  v1::GetCameraResponse response;
  *response.mutable_camera() = camera_;
  response.mutable_camera()->set_name(options_.name);
  response.set_backend("replay");
  std::vector<nanoseconds> intervals;
  double shortest_ms = frames_.front().frame.exposure_ms(), longest_ms = shortest_ms;
  nanoseconds readout{};
  for (const Replayed& replayed : frames_) {
    intervals.push_back(replayed.interval);
    shortest_ms = std::min(shortest_ms, replayed.frame.exposure_ms());
    longest_ms = std::max(longest_ms, replayed.frame.exposure_ms());
    readout = std::max(readout, replayed.length - exposure_of(replayed.frame));
  }
  const auto middle = intervals.begin() + intervals.size() / 2;
  std::nth_element(intervals.begin(), middle, intervals.end());
  response.set_frame_rate_hz(1e9 / static_cast<double>(middle->count()));
  response.set_min_exposure_ms(shortest_ms);
  response.set_max_exposure_ms(longest_ms);
  response.set_readout_ns(readout.count());
  return response;
}

absl::Status ReplayCamera::start(double exposure_ms) {
  std::vector<const Replayed*> wanted;
  std::set<double> held_ms;
  for (const Replayed& replayed : frames_) {
    held_ms.insert(replayed.frame.exposure_ms());
    if (same_exposure(replayed.frame.exposure_ms(), exposure_ms)) wanted.push_back(&replayed);
  }
  if (wanted.empty()) {
    std::string list;
    for (const double each : held_ms) list += fmt::format("{}{}", list.empty() ? "" : ", ", each);
    return absl::InvalidArgumentError(
        fmt::format("exposure_ms is {}; the archive's frames have {}", exposure_ms, list));
  }
  const std::lock_guard lock(mutex_);
  running_ = std::move(wanted);
  at_ = 0;
  next_start_ = monotonic_now();
  return absl::OkStatus();
}

void ReplayCamera::stop() {
  const std::lock_guard lock(mutex_);
  running_.clear();
}

std::optional<CapturedFrame> ReplayCamera::next(std::chrono::milliseconds timeout) {
  const nanoseconds deadline = monotonic_now() + timeout;
  std::unique_lock lock(mutex_);
  if (running_.empty()) return std::nullopt;
  const Replayed& replayed = *running_[at_];
  const nanoseconds start = next_start_, end = start + replayed.length;
  if (end > deadline) {
    lock.unlock();
    sleep_until_monotonic(deadline);
    return std::nullopt;
  }
  next_start_ += replayed.interval;
  at_ = (at_ + 1) % running_.size();
  const std::int64_t sequence = ++sequence_;
  lock.unlock();
  sleep_until_monotonic(end);
  CapturedFrame frame;
  frame.taken.set_sequence(sequence);
  frame.taken.set_exposure_start_ns(start.count());
  frame.taken.set_exposure_end_ns(end.count());
  frame.taken.set_uncertainty_ns(kUncertainty.count());
  frame.taken.set_exposure_ms(replayed.frame.exposure_ms());
  frame.taken.set_gain(replayed.frame.gain());
  frame.taken.set_width_px(camera_.width_px());
  frame.taken.set_height_px(camera_.height_px());
  // Read from disk only when wanted, but kept as long as a camera's buffer would be.
  frame.held_bytes = frame_bytes(shape_of(camera_));
  frame.image = [this, &replayed] {
    return read_picture(options_.archive / replayed.frame.file(), replayed.frame, camera_);
  };
  return frame;
}

}  // namespace glasswing
