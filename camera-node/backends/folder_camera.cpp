#include "camera-node/backends/folder_camera.h"

#include <absl/strings/str_replace.h>
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>

#include "core/base/checksum.h"
#include "core/base/status.h"
#include "core/base/utf8.h"
#include "core/file/file.h"
#include "core/image/image_file.h"
#include "core/image/raw_photograph.h"
#include "core/process/run_program.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

constexpr double kExposureRange = 0.005;      // around the recorded one, as a fraction
constexpr double kRateForEstimates_hz = 0.5;  // for estimates
constexpr std::chrono::milliseconds kFolderPoll(50);
constexpr nanoseconds kGivenUp =
    std::chrono::seconds(5);    // a file that has not changed for so long is complete
constexpr size_t kNewest = 64;  // files with which a copy is compared
constexpr std::string_view kGphoto2 =
    "gphoto2 --quiet --capture-image-and-download --force-overwrite --filename {dir}/%Y%m%d-%H%M%S-%03n.%C";

std::string file_name_of(const fs::path& path) {
  return printable(path.filename().string());
}

// Cameras record 1/60 s when they expose for 16.67 ms.
bool alike_ms(double a_ms, double b_ms) {
  return std::abs(a_ms - b_ms) <= 1.1 * kExposureRange * b_ms;
}

absl::StatusOr<std::string> read_limited(const fs::path& path) {
  std::error_code error;
  const std::int64_t size = fs::file_size(path, error);
  if (!error && size > kMaxRawBytes)
    return absl::DataLossError(
        fmt::format("it has {} bytes; the maximum for a picture is {}", size, kMaxRawBytes));
  return read_file(path);
}

}  // namespace

absl::StatusOr<std::unique_ptr<FolderCamera>> FolderCamera::open(const Options& options) {
  if (!options.curve.empty() && options.curve != "unknown") {
    if (const auto curve = PhotographResponse::create(options.curve, 0.0); !curve.ok())
      return absl::InvalidArgumentError("--curve: " + std::string(curve.status().message()) + ", or unknown");
  }
  GW_ASSIGN_OR_RETURN(FolderWatch watch, FolderWatch::open(options.directory));
  std::unique_ptr<FolderCamera> camera(new FolderCamera(options, std::move(watch)));
  const std::string command = options.shoot == "gphoto2" ? std::string(kGphoto2) : options.shoot;
  for (const std::string& word : command_words(command))
    camera->words_.push_back(absl::StrReplaceAll(word, {{"{dir}", options.directory.string()}}));
  GW_RETURN_IF_ERROR(camera->find_first());
  return camera;
}

FolderCamera::~FolderCamera() {
  stop();
}

absl::Status FolderCamera::find_first() {
  const nanoseconds begin = monotonic_now();
  if (!words_.empty()) {
    watch_.forget_all(begin);
    shoot();
  }
  std::optional<Picture> found;
  const nanoseconds until = begin + (words_.empty() ? 2 * FolderWatch::kQuiet : options_.patience);
  while (!found && monotonic_now() < until) {
    sleep_until_monotonic(monotonic_now() + kFolderPoll);
    found = next_picture();
  }
  const std::lock_guard lock(mutex_);
  if (!found) {
    const std::string advice = words_.empty() ? "take one with the settings for the capture, then start again"
                                              : "switch on the camera, and try the command by hand";
    return absl::FailedPreconditionError(
        fmt::format("{} {} no picture from which to learn the properties of the camera's pictures{}; {}",
                    options_.directory.string(), words_.empty() ? "holds" : "got",
                    problem_.empty() ? "" : ": " + problem_, advice));
  }
  first_ = *std::move(found);
  first_->image = nullptr;
  problem_.clear();
  return absl::OkStatus();
}

v1::GetCameraResponse FolderCamera::describe() const {
  v1::GetCameraResponse response;
  *response.mutable_camera() = first_->camera;
  response.mutable_camera()->set_name(options_.name);
  response.set_backend("folder");
  response.set_frame_rate_hz(kRateForEstimates_hz);
  response.set_min_exposure_ms((1.0 - kExposureRange) * first_->exposure_ms);
  response.set_max_exposure_ms((1.0 + kExposureRange) * first_->exposure_ms);
  response.set_on_demand(true);
  const std::lock_guard lock(mutex_);
  if (!due_) return response;
  v1::PictureDue& due = *response.mutable_due();
  due.set_what(due_->what);
  due.set_waited_ns((monotonic_now() - due_->since).count());
  due.set_by_hand(words_.empty());
  if (!words_.empty()) due.set_patience_ns(options_.patience.count());
  due.set_problem(due_->problem);
  return response;
}

absl::Status FolderCamera::start(double exposure_ms) {
  if (!alike_ms(exposure_ms, first_->exposure_ms)) {
    return absl::InvalidArgumentError(fmt::format(
        "exposure_ms is {}; the camera's pictures are exposed for {:.6g} ms: set the plan's exposure_ms to "
        "that, or set the camera, and restart glasswing-camera",
        exposure_ms, first_->exposure_ms));
  }
  const nanoseconds now = monotonic_now();
  watch_.forget_all(now);  // pictures of nothing that is shown now
  const std::lock_guard lock(mutex_);
  running_ = true;
  started_ = now;
  files_ = 0;
  return absl::OkStatus();
}

void FolderCamera::stop() {
  std::jthread shooting;
  {
    const std::lock_guard lock(mutex_);
    running_ = false;
    due_.reset();
    shooting = std::move(shooting_);
  }
  shooting.request_stop();
}

absl::Status FolderCamera::take_picture(const std::string& what) {
  {
    const std::lock_guard lock(mutex_);
    if (!running_)
      return absl::FailedPreconditionError("the camera takes pictures only while it is capturing");
    due_ = Due{.what = what, .problem = "", .since = monotonic_now()};
  }
  if (!words_.empty()) shoot();
  return absl::OkStatus();
}

void FolderCamera::shoot() {
  const std::lock_guard lock(mutex_);
  shooting_ = std::jthread([this, earlier = std::move(shooting_)](std::stop_token stop) mutable {
    earlier = {};  // a camera takes one picture at a time
    if (stop.stop_requested()) return;
    const auto limit = std::chrono::duration_cast<std::chrono::milliseconds>(options_.patience);
    const absl::Status shot = run_command(words_, {.limit = limit, .stop = stop});
    if (!shot.ok() && !stop.stop_requested()) note_problem(std::string(shot.message()));
  });
}

void FolderCamera::note_problem(const std::string& problem) {
  spdlog::warn("camera={} folder={} problem=\"{}\"", options_.name, options_.directory.string(), problem);
  const std::lock_guard lock(mutex_);
  (due_ ? due_->problem : problem_) = problem;
}

std::optional<CapturedFrame> FolderCamera::next(std::chrono::milliseconds timeout) {
  const nanoseconds deadline = monotonic_now() + timeout;
  while (true) {
    {
      const std::lock_guard lock(mutex_);
      if (!running_) return std::nullopt;
    }
    if (std::optional<Picture> picture = next_picture()) {
      const std::lock_guard lock(mutex_);
      CapturedFrame frame;
      const nanoseconds now = monotonic_now();
      // Starts differ, so that frames are never confused.
      const nanoseconds start = (due_ ? due_->since : started_) + nanoseconds(files_++);
      if (due_) due_->problem.clear();
      frame.taken.set_sequence(++sequence_);
      frame.taken.set_exposure_start_ns(start.count());
      frame.taken.set_exposure_end_ns(now.count());
      frame.taken.set_exposure_ms(picture->exposure_ms);
      frame.taken.set_gain(picture->gain);
      frame.taken.set_width_px(picture->image->width_px);
      frame.taken.set_height_px(picture->image->height_px);
      frame.taken.set_untimed(true);
      frame.held_bytes = picture->image->samples.size() * sizeof(std::uint16_t);
      frame.image = [image = picture->image] { return *image; };
      return frame;
    }
    const nanoseconds now = monotonic_now();
    if (now >= deadline) return std::nullopt;
    sleep_until_monotonic(std::min(deadline, now + kFolderPoll));
  }
}

std::optional<FolderCamera::Picture> FolderCamera::next_picture() {
  absl::StatusOr<std::vector<FolderWatch::File>> files = watch_.look(monotonic_now());
  if (!files.ok()) {
    const std::lock_guard lock(mutex_);
    (due_ ? due_->problem : problem_) = std::string(files.status().message());
    return std::nullopt;
  }
  if (!first_) std::ranges::reverse(*files);  // the newest tells what later ones will be
  for (const FolderWatch::File& file : *files) {
    const absl::StatusOr<std::string> bytes = read_limited(file.path);
    if (absl::IsNotFound(bytes.status())) continue;  // renamed, or deleted
    absl::Status status = bytes.status();
    std::string checksum;
    if (status.ok()) {
      checksum = checksum_of(*bytes);
      if (std::ranges::find(newest_, checksum) != newest_.end()) {
        watch_.forget(file.path);
        note_problem(fmt::format("{} is a copy of an earlier file", file_name_of(file.path)));
        continue;
      }
      absl::StatusOr<Picture> picture = read(file.path, *bytes);
      status = picture.status();
      if (status.ok() && first_) status = check_like_first(*picture);
      if (status.ok()) {
        watch_.forget(file.path);
        newest_.push_back(checksum);
        if (newest_.size() > kNewest) newest_.pop_front();
        return *std::move(picture);
      }
    }
    // An unreadable file may be incomplete.
    const bool given_up = !absl::IsDataLoss(status) || file.unchanged >= kGivenUp;
    if (!given_up && first_) continue;
    if (given_up) watch_.forget(file.path);
    const std::string said(status.message()), whole = file.path.string() + ": ";
    note_problem(fmt::format("{}: {}", file_name_of(file.path),
                             said.starts_with(whole) ? said.substr(whole.size()) : said));
  }
  return std::nullopt;
}

absl::StatusOr<FolderCamera::Picture> FolderCamera::read(const fs::path& path, std::string_view bytes) const {
  GW_ASSIGN_OR_RETURN(CodedPhotograph photograph, decode_photograph(path, bytes));
  const std::optional<double> exposure_ms =
      photograph.exposure_ms ? photograph.exposure_ms : options_.exposure_ms;
  if (!exposure_ms)
    return absl::FailedPreconditionError("it does not record its exposure time; give --exposure-ms");
  Picture picture{.image = nullptr, .camera = {}, .exposure_ms = *exposure_ms};
  constexpr double kBaseIso = 100.0;
  if (photograph.iso) picture.gain = *photograph.iso / kBaseIso;
  picture.camera.set_width_px(photograph.codes.width_px);
  picture.camera.set_height_px(photograph.codes.height_px);
  picture.camera.set_bits(std::max(photograph.bits, 8));
  picture.camera.set_mosaic(photograph.mosaic);
  picture.camera.set_response("linear");
  if (photograph.raw) {
    if (first_) set_black(first_->camera.black_level(), photograph);
    picture.camera.set_black_level(photograph.black_level);
  } else if (options_.curve == "unknown") {
    picture.camera.set_response("unknown");
  } else {
    const std::string by_bits = photograph.bits <= 8 ? "srgb" : "linear";
    GW_ASSIGN_OR_RETURN(const PhotographResponse response,
                        PhotographResponse::create(options_.curve.empty() ? by_bits : options_.curve, 0.0));
    response.linearise(photograph.codes);
  }
  picture.image = std::make_shared<const Image16>(std::move(photograph.codes));
  return picture;
}

absl::Status FolderCamera::check_like_first(const Picture& picture) const {
  const auto said = [](const Picture& each) {
    return fmt::format("{}x{} px of {} bits{}, exposed for {:.6g} ms at gain {:.4g}", each.camera.width_px(),
                       each.camera.height_px(), each.camera.bits(),
                       each.camera.mosaic().empty() ? "" : ", mosaic " + each.camera.mosaic(),
                       each.exposure_ms, each.gain);
  };
  const bool alike = picture.camera.width_px() == first_->camera.width_px() &&
                     picture.camera.height_px() == first_->camera.height_px() &&
                     picture.camera.mosaic() == first_->camera.mosaic() &&
                     picture.camera.bits() == first_->camera.bits() &&
                     alike_ms(picture.exposure_ms, first_->exposure_ms) && picture.gain == first_->gain;
  if (alike) return absl::OkStatus();
  return absl::FailedPreconditionError(fmt::format(
      "it is {}; the first picture was {}: set the camera to manual", said(picture), said(*first_)));
}

}  // namespace glasswing
