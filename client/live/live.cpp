#include <fmt/format.h>
#include <unistd.h>

#include <csignal>
#include <iostream>
#include <thread>

#include "client/cli/settings.h"
#include "client/live/camera_clock.h"
#include "client/live/commands.h"
#include "client/live/live_figures.h"
#include "client/live/live_output.h"
#include "client/live/ramp_holder.h"
#include "compositing/picture/moving_picture.h"
#include "core/base/status.h"
#include "core/cli/interrupt.h"
#include "core/cli/progress.h"
#include "core/image/image_file.h"
#include "core/method/methods.h"
#include "core/pattern/plan.h"
#include "glasswing/v1/camera_service.grpc.pb.h"
#include "glasswing/v1/live_service.grpc.pb.h"

namespace glasswing {
namespace {

constexpr double kPictureRateHz = 30.0;  // of a moving background

struct LiveArguments {
  std::string monitor, camera, background, output = "window";
  double exposure_ms = 4.0;
  std::vector<std::string> settings;
  int frames = 0;  // 0: until the output is closed
};

using LiveStream = grpc::ClientReaderWriter<v1::RunLiveRequest, v1::RunLiveResponse>;

bool send_picture(LiveStream& stream, const std::string& file) {
  for (size_t at = 0; at < file.size(); at += kChunkBytes) {
    v1::RunLiveRequest request;
    request.set_picture(file.substr(at, kChunkBytes));
    request.set_picture_ends(at + kChunkBytes >= file.size());
    if (!stream.Write(request)) return false;
  }
  return true;
}

// Waits for Enter; returns at once at the end of standard input.
void wait_for_person(const std::string& what) {
  std::cerr << what << ", then press Enter" << std::endl;
  std::string line;
  std::getline(std::cin, line);
}

class Live {
 public:
  Live(const Client& client, const LiveArguments& arguments) : client_(client), arguments_(arguments) {}

  absl::Status run() {
    GW_ASSIGN_OR_RETURN(const auto options, parse_settings(arguments_.settings));
    GW_RETURN_IF_ERROR(OptionValues::read(kRampMethod, options).status());
    GW_ASSIGN_OR_RETURN(MovingPicture background,
                        MovingPicture::open(arguments_.background, [](const auto& file) {
                          return read_radiance(file, Encoding::kDisplay);
                        }));
    GW_ASSIGN_OR_RETURN(const RadianceImage first, background.next());
    GW_ASSIGN_OR_RETURN(target_, LiveTarget::create(arguments_.output));
    GW_ASSIGN_OR_RETURN(ramp_, RampHolder::hold(client_, arguments_.monitor, arguments_.camera));
    const v1::ShowRampResponse rig = ramp_->shown();  // a copy: bring_object() replaces it
    if (rig.needs_operator()) wait_for_person("Take the object off the stage");
    GW_ASSIGN_OR_RETURN(clock_, CameraClock::follow(rig.camera_address()));
    const Peer<v1::CameraService> camera("camera node at " + rig.camera_address(), rig.camera_address());
    GW_ASSIGN_OR_RETURN(camera_, call(camera, &v1::CameraService::Stub::GetCamera, {}));
    GW_ASSIGN_OR_RETURN(const std::string first_file, jpeg_for(rig.monitor(), first));

    const Interruptible ctrl_c([this] { context_.TryCancel(); });
    const Peer<v1::LiveService> solver("solver at " + rig.solver_address(), rig.solver_address());
    stream_ = solver.stub->RunLive(&context_);
    v1::RunLiveRequest request;
    v1::LiveStart& start = *request.mutable_start();
    start.set_camera_address(rig.camera_address());
    start.set_exposure_ms(arguments_.exposure_ms);
    *start.mutable_monitor() = rig.monitor();
    start.mutable_options()->insert(options.begin(), options.end());
    if (rig.has_camera_calibration()) *start.mutable_camera_calibration() = rig.camera_calibration();
    stream_->Write(request);
    send_picture(*stream_, first_file);
    std::jthread moving;
    if (!background.is_still()) {
      moving = std::jthread([&](std::stop_token stop) { move_background(background, rig.monitor(), stop); });
    }
    const absl::Status shown = show_frames();
    moving.request_stop();
    const bool broken_off = interrupted();
    if (enough_ || !shown.ok()) context_.TryCancel();
    if (moving.joinable()) moving.join();
    const grpc::Status ended = stream_->Finish();
    GW_RETURN_IF_ERROR(ramp_->status());
    GW_RETURN_IF_ERROR(background_error_);
    GW_RETURN_IF_ERROR(shown);
    if (!enough_ && !broken_off) return status_from(ended, solver.title);
    report();
    return enough_ ? absl::OkStatus() : absl::CancelledError("interrupted; the rig is free again");
  }

 private:
  // Runs until there are enough frames, the output is closed, or the stream ends.
  absl::Status show_frames() {
    std::unique_ptr<LiveOutput> output;
    std::string picture;
    v1::LiveFrame frame;
    bool object = false;
    std::optional<Waiting> waiting("learning the empty stage");
    for (v1::RunLiveResponse response; !enough_ && stream_->Read(&response);) {
      if (!response.has_frame()) {
        if (response.empty_frames_left() > 0 || object) continue;
        object = true;
        waiting.reset();
        GW_RETURN_IF_ERROR(ramp_->bring_object([this] { context_.TryCancel(); }));
        if (ramp_->shown().needs_operator()) wait_for_person("The empty stage is known. Bring the object");
        go_ = monotonic_now();
        continue;
      }
      if (response.frame().has_taken()) {
        frame = std::move(*response.mutable_frame());
        picture = std::move(*frame.mutable_picture());
      } else {
        picture += response.frame().picture();
      }
      const int width = frame.taken().width_px(), height = frame.taken().height_px();
      if (picture.size() < 3 * static_cast<size_t>(width) * height) continue;
      const ClockReading exposed = clock_->local(nanoseconds(frame.taken().exposure_start_ns()));
      if (exposed.time < go_) continue;  // exposed before the object came
      if (output == nullptr) {
        GW_ASSIGN_OR_RETURN(output, target_->open(width, height, camera_.frame_rate_hz()));
      }
      GW_RETURN_IF_ERROR(
          output->show({reinterpret_cast<const std::uint8_t*>(picture.data()), picture.size()}));
      const nanoseconds shown = monotonic_now();
      figures_.add(frame, exposed, clock_->local(nanoseconds(frame.taken().exposure_end_ns())), shown);
      print_status(shown);
      enough_ = output->is_closed() || figures_.frames() == static_cast<size_t>(arguments_.frames);
    }
    return absl::OkStatus();
  }

  static absl::StatusOr<std::string> jpeg_for(const v1::Monitor& monitor, const RadianceImage& picture) {
    return encode_jpeg(resized(picture, monitor.width_px(), monitor.height_px()));
  }

  static absl::StatusOr<std::string> next_file(MovingPicture& background, const v1::Monitor& monitor) {
    GW_ASSIGN_OR_RETURN(const RadianceImage picture, background.next());
    return jpeg_for(monitor, picture);
  }

  void move_background(MovingPicture& background, const v1::Monitor& monitor, std::stop_token stop) {
    const nanoseconds period(static_cast<std::int64_t>(1e9 / kPictureRateHz));
    for (nanoseconds due = monotonic_now() + period; !stop.stop_requested(); due += period) {
      const absl::StatusOr<std::string> file = next_file(background, monitor);
      if (!file.ok()) {
        background_error_ = file.status();
        context_.TryCancel();
        return;
      }
      due = std::max(due, monotonic_now());
      sleep_until_monotonic(due);
      if (!send_picture(*stream_, *file)) return;
    }
  }

  void print_status(nanoseconds now) {
    constexpr std::chrono::seconds kBetweenLines(1);
    if (client_.json || ::isatty(STDERR_FILENO) == 0 || now - printed_ < kBetweenLines) return;
    printed_ = now;
    std::cerr << "\r\033[K" << figures_.line() << std::flush;
  }

  void report() const {
    if (client_.json) {
      std::cout << figures_.json().dump(2) << std::endl;
      return;
    }
    if (printed_ != nanoseconds(0)) std::cerr << "\r\033[K";
    std::cout << figures_.line() << std::endl;
  }

  const Client& client_;
  const LiveArguments& arguments_;
  std::optional<LiveTarget> target_;
  std::unique_ptr<RampHolder> ramp_;
  std::unique_ptr<CameraClock> clock_;
  v1::GetCameraResponse camera_;
  grpc::ClientContext context_;
  std::unique_ptr<LiveStream> stream_;
  LiveFigures figures_;
  absl::Status background_error_;  // written before the stream ends
  nanoseconds go_{}, printed_{};
  bool enough_ = false;
};

}  // namespace

void add_live_command(CLI::App& app, Client& client) {
  CLI::App& command =
      *app.add_subcommand("live", "Composite the object over another picture live, as the camera sees it.");
  command.footer(
      "The server shows the colour ramp on the monitor, and a listening solver averages frames of the empty "
      "stage. Once\nthe object is in place, frames become composites as fast as the solver can process them. "
      "Escape or q "
      "closes the window.\n\nExamples:\n"
      "  glasswing live --background harbour.png\n"
      "  glasswing live --background sea.mp4 --output - | ffplay -\n"
      "  glasswing live --background harbour.png --output frames/ --frames 100 --json");
  auto arguments = std::make_shared<LiveArguments>();
  command
      .add_option("--background", arguments->background, "a picture, a directory of them, or a video, sRGB")
      ->required();
  command.add_option("--monitor", arguments->monitor,
                     "the monitor for the ramp; needed if there are several");
  command.add_option("--camera", arguments->camera, "the camera node; needed if several are up")
      ->type_name("NODE");
  command.add_option("--exposure-ms", arguments->exposure_ms, "exposure of each frame, ms")
      ->check(CLI::Range(0.01, 10000.0))
      ->capture_default_str();
  command
      .add_option("--set", arguments->settings,
                  "an option of method ramp (glasswing solve --help ramp); may be repeated")
      ->type_name("NAME=VALUE");
  command
      .add_option("--output", arguments->output,
                  "window; - (standard output) or FILE: YUV4MPEG2; DIR/: numbered PNGs")
      ->capture_default_str();
  command.add_option("--frames", arguments->frames, "stop after this many frames with the object")
      ->check(CLI::Range(1, 100000000));
  command.callback([&client, arguments] {
    client.run = [&client, arguments] {
      std::signal(SIGPIPE, SIG_IGN);  // a closed pipe is reported as a write error
      return Live(client, *arguments).run();
    };
  });
}

}  // namespace glasswing
