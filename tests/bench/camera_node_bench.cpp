// A camera node at the rate of a 5-megapixel camera: glasswing-camera replays frames of 2560 x 1920
// photosites of 12 bits at 30 frames/s from memory, each another id patch, and is asked for each of 400
// frames as the server asks while two refreshes of 60 Hz show a step. Counts frames that were not kept, kept
// frames whose pixels are another step's, and the node's processor time.
#include <fmt/format.h>
#include <sys/wait.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <csignal>
#include <fstream>
#include <mutex>
#include <random>
#include <set>
#include <thread>

#include "core/base/time.h"
#include "core/file/file.h"
#include "core/frame/archive.h"
#include "core/pattern/id_patch.h"
#include "core/service/service.h"
#include "glasswing/v1/archive_service.grpc.pb.h"
#include "glasswing/v1/camera_service.grpc.pb.h"
#include "tests/bench/rows.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

constexpr int kWidth_px = 2560, kHeight_px = 1920, kBits = 12;
constexpr int kPictures = 64;  // that the camera shows in turn; each is one of as many ids
// The node knows frames of the second exposure by patches of the first, and the replay keeps them apart.
constexpr double kExposure_ms = 4.0, kLearningExposure_ms = 4.06;
constexpr std::chrono::milliseconds kPoll(10);  // the server's

struct Options {
  std::string camera;
  fs::path work = "/dev/shm";
  int steps = 400;
  double fps = 30.0;
};

template <typename T>
T value(absl::StatusOr<T> result) {
  if (result.ok()) return *std::move(result);
  fmt::print(stderr, "{}\n", result.status().ToString());
  std::exit(1);
}
void check(const absl::Status& status) {
  if (!status.ok()) value<int>(status);
}
void check(const grpc::Status& status) {
  check(from_grpc(status, "camera node"));
}

std::uint16_t id_of(int picture) {
  return static_cast<std::uint16_t>((picture + 1) * 40503);
}

// A mosaic with shot noise, whose lowest rows show an id.
Image16 picture(std::uint16_t id, std::uint32_t seed) {
  constexpr IdPatch kPatch{.width_px = kWidth_px, .first_row = 0, .rows = 64};
  RadianceImage strip(kWidth_px, kPatch.rows);
  kPatch.draw(id, strip);
  Image16 image(kWidth_px, kHeight_px, 1);
  std::minstd_rand random(seed);
  for (int y = 0; y < kHeight_px; ++y) {
    const int patch_row = y - (kHeight_px - kPatch.rows);
    for (int x = 0; x < kWidth_px; ++x) {
      const double light = patch_row >= 0 ? 0.05 + 0.5 * strip.at(x, patch_row, 0)
                                          : 0.3 + 0.2 * std::sin(0.01 * x) * std::cos(0.013 * y);
      // Four electrons a code; the sum of uniform numbers is nearly a normal one.
      double noise = -6.0;
      for (int i = 0; i < 12; ++i) noise += static_cast<double>(random()) / decltype(random)::max();
      const double electrons = light * 4.0 * ((1 << kBits) - 1);
      const double code = std::clamp((electrons + std::sqrt(electrons) * noise) / 4.0, 0.0, 4095.0);
      image.samples[static_cast<size_t>(y) * kWidth_px + x] =
          static_cast<std::uint16_t>(std::lround(code) << (16 - kBits));
    }
  }
  return image;
}

v1::CaptureManifest header(const std::string& session) {
  v1::CaptureManifest header;
  header.set_format_version(1);
  header.set_session(session);
  v1::Camera& camera = *header.mutable_camera();
  camera.set_name("camera-1");
  camera.set_width_px(kWidth_px);
  camera.set_height_px(kHeight_px);
  camera.set_bits(kBits);
  camera.set_mosaic("RGGB");
  v1::Monitor& monitor = *header.add_monitors();
  monitor.set_name("back");
  monitor.set_width_px(3840);
  monitor.set_height_px(2160);
  return header;
}

void write_source(const fs::path& directory) {
  const auto archive = value(Archive::create(directory, header("source")));
  int step = 0;
  const auto add = [&](std::uint16_t id, double exposure_ms) {
    Archive::NewFrame frame;
    frame.record.set_step(step++);
    frame.record.set_exposure_ms(exposure_ms);
    frame.record.set_gain(1.0);
    frame.image = picture(id, static_cast<std::uint32_t>(step));
    value(archive->add({std::move(frame)}));
  };
  for (const std::uint16_t id : patch_learning_ids()) add(id, kLearningExposure_ms);
  for (int i = 0; i < kPictures; ++i) add(id_of(i), kExposure_ms);
  check(archive->seal());
}

class Node {
 public:
  Node(const Options& options, const fs::path& source, const fs::path& data) {
    const std::string address = fmt::format("127.0.0.1:{}", 20000 + ::getpid() % 20000);
    const std::vector<std::string> words{options.camera,
                                         "--listen",
                                         address,
                                         "--data",
                                         data,
                                         "--backend",
                                         "replay",
                                         "--archive",
                                         source,
                                         "--fps",
                                         fmt::to_string(options.fps)};
    std::vector<char*> arguments;
    for (const std::string& word : words) arguments.push_back(const_cast<char*>(word.c_str()));
    arguments.push_back(nullptr);
    pid_ = ::fork();
    if (pid_ == 0) {
      ::execv(arguments[0], arguments.data());
      ::_exit(127);
    }
    const auto channel = dial(address);
    cameras = v1::CameraService::NewStub(channel);
    archives = v1::ArchiveService::NewStub(channel);
  }
  ~Node() {
    ::kill(pid_, SIGTERM);
    ::waitpid(pid_, nullptr, 0);
  }
  double processor_seconds() const {
    std::ifstream stat(fmt::format("/proc/{}/stat", pid_));
    std::string word;
    double user = 0.0, system = 0.0;
    for (int i = 1; i <= 13; ++i) stat >> word;
    stat >> user >> system;
    return (user + system) / static_cast<double>(::sysconf(_SC_CLK_TCK));
  }
  // The most memory so far.
  double peak_gb() const {
    std::ifstream status(fmt::format("/proc/{}/status", pid_));
    for (std::string word; status >> word;) {
      double kilobytes = 0.0;
      if (word == "VmHWM:" && status >> kilobytes) return kilobytes * 1024.0 / 1e9;
    }
    return 0.0;
  }

  std::unique_ptr<v1::CameraService::Stub> cameras;
  std::unique_ptr<v1::ArchiveService::Stub> archives;

 private:
  pid_t pid_ = 0;
};

// A running capture, whose frames are read as they are reported.
class Capture {
 public:
  Capture(Node& node, double exposure_ms) {
    v1::CaptureRequest request;
    request.set_exposure_ms(exposure_ms);
    reader_ = node.cameras->Capture(&context_, request);
    v1::CaptureResponse running;
    if (!reader_->Read(&running)) check(reader_->Finish());
    thread_ = std::jthread([this] {
      for (v1::CaptureResponse response; reader_->Read(&response);) {
        const std::lock_guard lock(mutex_);
        taken_.push_back(response.frame());
      }
    });
  }
  ~Capture() {
    context_.TryCancel();
    thread_.join();
    (void)reader_->Finish();
  }
  std::vector<v1::FrameTaken> take() {
    const std::lock_guard lock(mutex_);
    return std::exchange(taken_, {});
  }

 private:
  grpc::ClientContext context_;
  std::unique_ptr<grpc::ClientReader<v1::CaptureResponse>> reader_;
  std::mutex mutex_;
  std::vector<v1::FrameTaken> taken_;  // guarded by mutex_
  std::jthread thread_;
};

v1::Frame record_of(const v1::FrameTaken& taken, int step) {
  v1::Frame frame;
  frame.set_step(step);
  frame.set_sequence(taken.sequence());
  frame.set_exposure_ms(taken.exposure_ms());
  frame.set_gain(taken.gain());
  frame.set_exposure_start_ns(taken.exposure_start_ns());
  frame.set_exposure_end_ns(taken.exposure_end_ns());
  frame.mutable_stimulus()->set_panel("back");
  return frame;
}

void learn_patches(Node& node) {
  v1::LearnPatchesRequest request;
  request.set_session("s");
  Capture capture(node, kLearningExposure_ms);
  const auto ids = patch_learning_ids();
  while (static_cast<size_t>(request.frames_size()) < ids.size()) {
    for (const v1::FrameTaken& taken : capture.take()) {
      const size_t at = request.frames_size();
      if (at == ids.size()) break;
      v1::Frame& frame = *request.add_frames() = record_of(taken, static_cast<int>(at));
      frame.mutable_stimulus()->set_kind("patch");
      frame.mutable_stimulus()->set_patch_id(ids[at]);
    }
    std::this_thread::sleep_for(kPoll);
  }
  v1::LearnPatchesResponse learned;
  grpc::ClientContext context;
  check(node.cameras->LearnPatches(&context, request, &learned));
  if (learned.frames_size() != static_cast<int>(ids.size()) || learned.unseen_patches_size() > 0)
    check(absl::FailedPreconditionError("the id patches are not seen: " + learned.ShortDebugString()));
}

// The steps whose frame was kept.
std::set<int> play(Node& node, const Options& options, int first_step) {
  std::set<int> kept;
  Capture capture(node, kExposure_ms);
  std::int64_t first_sequence = 0, next = 0;
  while (next < options.steps) {
    v1::KeepFramesRequest request;
    request.set_session("s");
    for (const v1::FrameTaken& taken : capture.take()) {
      if (first_sequence == 0) first_sequence = taken.sequence();
      next = taken.sequence() - first_sequence + 1;
      if (next > options.steps) break;
      const auto step = static_cast<int>(next) - 1;
      v1::Frame& frame = *request.add_frames() = record_of(taken, first_step + step);
      frame.mutable_stimulus()->set_kind("solid");
      frame.set_patch_id(id_of(step % kPictures));
    }
    if (request.frames_size() > 0) {
      v1::KeepFramesResponse response;
      grpc::ClientContext context;
      check(node.cameras->KeepFrames(&context, request, &response));
      for (const v1::Frame& frame : response.frames()) kept.insert(frame.step() - first_step);
    }
    std::this_thread::sleep_for(kPoll);
  }
  return kept;
}

// How many frames of these steps hold other pixels than the picture that the camera saw, or no proof by them.
int mislabelled(const fs::path& kept_in, const fs::path& source_in, int first_step) {
  const auto kept = value(Archive::open(kept_in)), source = value(Archive::open(source_in));
  const v1::CaptureManifest frames = kept->manifest(), pictures = source->manifest();
  int wrong = 0;
  for (const v1::Frame& frame : frames.frames()) {
    if (frame.step() < first_step) continue;
    const int at = first_step + (frame.step() - first_step) % kPictures;
    const Image16 seen = value(decode_tiff(value(kept->read_frame_bytes(frame.file()))));
    const Image16 shown = value(decode_tiff(value(source->read_frame_bytes(pictures.frames(at).file()))));
    wrong += seen.samples != shown.samples || frame.proof() != v1::PROOF_TIME_AND_PATCH;
  }
  return wrong;
}

void run(const Options& options) {
  const fs::path work = options.work / fmt::format("glasswing-bench.{}", ::getpid());
  const fs::path source = work / "source", data = work / "node";
  fs::create_directories(work);
  write_source(source);
  {
    Node node(options, source, data);
    v1::CreateArchiveRequest create;
    *create.mutable_manifest() = header("s");
    v1::CreateArchiveResponse created;
    grpc::ClientContext context;
    context.set_wait_for_ready(true);
    context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(30));
    check(node.archives->CreateArchive(&context, create, &created));
    learn_patches(node);
    const auto first_step = static_cast<int>(patch_learning_ids().size());
    const double before = node.processor_seconds();
    const nanoseconds began = monotonic_now();
    const std::set<int> kept = play(node, options, first_step);
    const double seconds = std::chrono::duration<double>(monotonic_now() - began).count();
    const double processor = node.processor_seconds() - before;
    fmt::print(stderr, "{} of {} frames kept in {:.1f} s\n", kept.size(), options.steps, seconds);
    print_row("camera node, 5 megapixels of 12 bits, 30 frames/s, 400 steps: frames lost",
              options.steps - static_cast<double>(kept.size()), "frames");
    print_row("camera node, 5 megapixels of 12 bits, 30 frames/s, 400 steps: frames mislabelled",
              mislabelled(data / "archives" / "s", source, first_step), "frames");
    print_row("camera node, 5 megapixels of 12 bits, 30 frames/s, 400 steps: processor time",
              1000.0 * processor / options.steps, "ms a frame");
    print_row("camera node, 5 megapixels of 12 bits, 30 frames/s, 400 steps: memory", node.peak_gb(), "GB");
  }
  fs::remove_all(work);
}

}  // namespace
}  // namespace glasswing

int main(int argc, char** argv) {
  glasswing::Options options;
  CLI::App app("Measures a camera node at the rate of a 5-megapixel camera.");
  app.add_option("--camera", options.camera, "the program glasswing-camera")->required();
  app.add_option("--work", options.work, "directory for 5 GB of frames")->capture_default_str();
  app.add_option("--steps", options.steps, "frames to be kept")->capture_default_str();
  app.add_option("--fps", options.fps, "frames a second")->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  glasswing::run(options);
}
