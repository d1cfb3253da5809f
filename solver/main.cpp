#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <csignal>
#include <iostream>
#include <thread>

#include "core/archive/archive_metrics.h"
#include "core/archive/archive_service.h"
#include "core/base/file.h"
#include "core/base/freed_memory.h"
#include "core/base/name.h"
#include "core/base/status.h"
#include "core/base/version.h"
#include "core/cli/daemon_options.h"
#include "core/cli/man_page.h"
#include "core/frame/image_file.h"
#include "core/import/mapped_archive.h"
#include "core/matte/matte_file.h"
#include "core/pattern/method_options.h"
#include "core/service/build_id.h"
#include "core/service/registration.h"
#include "core/service/service.h"
#include "core/service/supervision.h"
#include "core/telemetry/logs.h"
#include "core/telemetry/metrics.h"
#include "solver/background/object_mask.h"
#include "solver/live/live_service.h"
#include "solver/methods.h"
#include "solver/ramp/ramp_options.h"
#include "solver/ramp/video_layout.h"
#include "solver/worker/parallel_solve.h"
#include "solver/worker/solver_metrics.h"
#include "solver/worker/solver_name.h"
#include "solver/worker/vector_target.h"
#include "solver/worker/video_solve.h"
#include "solver/worker/work_loop.h"

namespace glasswing {
namespace {

struct Work {
  std::string server = "127.0.0.1:7440", name, archives;
  ListenOptions listen{.address = ""};
  TlsFiles tls;
  double until_idle_seconds = 0.0;
  int threads = 0;
  MetricsOptions metrics{.address = "", .program = "glasswing-solver", .build = build_id()};
};

absl::Status serve(const Work& work) {
  const std::string name = work.name.empty() ? solver_name() : work.name;
  GW_RETURN_IF_ERROR(check_name("node", name));
  GW_RETURN_IF_ERROR(use_tls(work.tls));
  v1::RegisterRequest node;
  node.set_kind(v1::NODE_KIND_SOLVER);
  node.set_name(name);
  node.set_build(build_id());
  char hostname[256] = "";
  ::gethostname(hostname, sizeof(hostname) - 1);
  node.mutable_solver()->set_host(hostname);
  node.mutable_solver()->set_threads(
      work.threads > 0 ? work.threads : static_cast<int>(std::thread::hardware_concurrency()));
  node.mutable_solver()->set_vectors(vector_target());
  LiveServiceImpl live(0);  // somebody watches: it takes all cores
  ArchiveStore archives(work.archives);
  ArchiveServiceImpl archive_service(archives);
  std::vector<grpc::Service*> services = {&live};
  if (!work.archives.empty()) {
    if (work.listen.address.empty())
      return absl::InvalidArgumentError("--archives needs --listen: others read from it");
    GW_RETURN_IF_ERROR(archives.prepare());
    services.push_back(&archive_service);
  }
  std::unique_ptr<ServiceHost> host;
  if (!work.listen.address.empty()) {
    GW_ASSIGN_OR_RETURN(host, ServiceHost::start(work.listen, services));
    node.set_address(host->advertised());
  }
  solver_metrics();
  archive_metrics();
  GW_ASSIGN_OR_RETURN(const std::unique_ptr<MetricsHost> metrics, MetricsHost::start(work.metrics));
  const Registration registration(work.server, node);
  absl::Status ended;
  {
    const std::jthread worker([&](std::stop_token stop) {
      ended = run_work_loop(
          {.server = work.server,
           .name = name,
           .threads = work.threads,
           .until_idle = std::chrono::milliseconds(std::llround(1000.0 * work.until_idle_seconds))},
          stop);
      ::kill(::getpid(), SIGTERM);  // for whoever waits below
    });
    serve_until_signal([&] { return host == nullptr || host->answers(kSelfCall); });
  }
  live.stop();
  archive_service.stop();
  if (host != nullptr) host->stop(std::chrono::seconds(2));
  return ended;
}

struct Solve {
  std::string archive, matte, method = "gaussian";
  std::vector<std::string> settings;
  int threads = 0;
};

// A matte a frame, 0000.exr and so on. The first error of a frame that none can be made of, once all others
// are there.
absl::Status solve_each_frame(const VideoMethod& method, const MappedArchive& archive, const Solve& solve) {
  const v1::CaptureManifest& manifest = archive.manifest();
  GW_ASSIGN_OR_RETURN(const VideoLayout layout, lay_out_video(manifest));
  const int count = static_cast<int>(layout.frames.size());
  const ReadFrame read = [&](int frame) -> absl::StatusOr<std::vector<std::uint16_t>> {
    const std::span<const std::uint16_t> rows = archive.rows(frame, 0, manifest.camera().height_px());
    return std::vector<std::uint16_t>(rows.begin(), rows.end());
  };
  GW_ASSIGN_OR_RETURN(const std::unique_ptr<VideoSource> source, read_ahead(manifest, 0, count, read));
  std::error_code failed;
  std::filesystem::create_directories(solve.matte, failed);
  if (failed)
    return absl::InvalidArgumentError(
        fmt::format("{}: it must be a directory: {}", solve.matte, failed.message()));
  const bool watched = ::isatty(STDERR_FILENO) != 0;
  absl::Status refused;  // the first of them
  const absl::Status status =
      solve_video(method, *source, 0, count, solve.threads, {},
                  [&](int frame, const absl::StatusOr<Matte>& matte) -> absl::Status {
                    refused.Update(matte.status());
                    if (!matte.ok()) return absl::OkStatus();
                    GW_ASSIGN_OR_RETURN(const std::string bytes, encode_matte(*matte));
                    if (watched) std::cerr << fmt::format("\rsolved {} of {} frames", frame + 1, count);
                    return write_file_durably(
                        std::filesystem::path(solve.matte) / fmt::format("{:04}.exr", frame), bytes);
                  });
  if (watched) std::cerr << "\n";
  GW_RETURN_IF_ERROR(status);
  return refused;
}

absl::Status solve(const Solve& solve) {
  MethodOptions options;
  for (const std::string& setting : solve.settings) {
    GW_ASSIGN_OR_RETURN(const auto option, parse_setting(setting));
    options[option.first] = option.second;
  }
  GW_ASSIGN_OR_RETURN(const std::unique_ptr<VideoMethod> video, make_video_method(solve.method, options));
  if (video != nullptr) {
    GW_ASSIGN_OR_RETURN(const auto archive, MappedArchive::open(solve.archive));
    return solve_each_frame(*video, *archive, solve);
  }
  GW_ASSIGN_OR_RETURN(const std::unique_ptr<Method> method, make_method(solve.method, options));
  GW_ASSIGN_OR_RETURN(const auto archive, MappedArchive::open(solve.archive));
  const bool watched = ::isatty(STDERR_FILENO) != 0;
  GW_ASSIGN_OR_RETURN(const Matte matte, solve_archive(*method, archive, solve.threads, [&](double part) {
                        if (watched) std::cerr << fmt::format("\rsolved {:3.0f} %", 100.0 * part);
                      }));
  if (watched) std::cerr << "\n";
  GW_ASSIGN_OR_RETURN(const std::string bytes, encode_matte(matte));
  return write_file_durably(solve.matte, bytes);
}

struct MaskPictures {
  std::string with, without, mask;
  MaskOptions options;
};

absl::Status make_mask(const MaskPictures& pictures) {
  GW_ASSIGN_OR_RETURN(const CodedPhotograph with, read_photograph(pictures.with));
  GW_ASSIGN_OR_RETURN(const CodedPhotograph without, read_photograph(pictures.without));
  MaskOptions options = pictures.options;
  options.bits = std::min(with.bits, without.bits);
  GW_ASSIGN_OR_RETURN(const ObjectMask object, ObjectMask::of_pair(with.codes, without.codes, options));
  const Mask mask = object.mask(with.codes);
  RadianceImage picture(mask.width_px, mask.height_px);
  for (size_t i = 0; i < picture.samples.size(); ++i)
    picture.samples[i] = mask.samples[i / 3] != 0 ? 1.0f : 0.0f;
  GW_RETURN_IF_ERROR(write_radiance(pictures.mask, picture, Encoding::kDisplay));
  const ImageRegistration& drift = object.registration();
  std::cout << fmt::format(
      "{}: {:.1f} % of the picture; shifted by {:+.2f} {:+.2f} px, corners by up to {:.2f} px; {:.3f} {:.3f} "
      "{:.3f} times as bright; noise "
      "{:.2f} codes of 255\n",
      pictures.mask, 100.0 * mask.coverage(), drift.shift_px[0], drift.shift_px[1],
      drift.max_px(mask.width_px, mask.height_px), drift.gain[0], drift.gain[1], drift.gain[2],
      255.0 * object.usual_noise());
  return absl::OkStatus();
}

CLI::App& add_mask_command(CLI::App& app, MaskPictures& pictures) {
  CLI::App& command = *app.add_subcommand("mask", "Find the object in a photograph, by one without it");
  command.footer(
      "The picture without the object is first moved and brightened to lie on the other, as far as a camera "
      "that was touched "
      "needs\nit; then what differs by more than noise is the object, cleaned by dilation, hole filling and "
      "erosion. White is the "
      "object.\n\nExample:\n  glasswing-solver mask vase.jpg empty.jpg mask.png");
  command.add_option("with", pictures.with, "photograph with the object: PNG, JPEG or TIFF")->required();
  command.add_option("without", pictures.without, "one without it, of the same size")->required();
  command.add_option("mask", pictures.mask, "PNG or TIFF to write")->required();
  MaskOptions& options = pictures.options;
  command
      .add_option(
          "--false-positive-rate", options.false_positive_rate,
          "of the difference test, where noise is normal: the share of other pixels taken for the object's")
      ->check(CLI::Range(1e-12, 0.5))
      ->capture_default_str();
  command
      .add_option("--dilate", options.dilation_px,
                  "px: half the side of the square that closes gaps; 0.3 % of the diagonal if left out")
      ->check(CLI::Range(0, 1000));
  command.add_option("--erode", options.erosion_px, "px, likewise; as --dilate if left out")
      ->check(CLI::Range(0, 1000));
  command
      .add_option("--least", options.min_px,
                  "px: what hangs together in fewer is noise; the square's area if left out")
      ->check(CLI::Range(0, 1 << 28));
  command.add_flag("!--keep-holes", options.fill_holes, "leave holes in it open");
  command.add_flag("!--no-drift", options.follow_drift, "the pictures lie on each other as they are");
  return command;
}

}  // namespace
}  // namespace glasswing

int main(int argc, char** argv) {
  using namespace glasswing;
  keep_freed_memory();
  CLI::App app("Glasswing's solver: turns frames into tiles of a matte, for as long as the server has any.");
  set_up_help(app, "glasswing-solver");
  app.footer(
      "Examples:\n  glasswing-solver --server 127.0.0.1:7440\n"
      "  glasswing-solver --name live-1 --listen 127.0.0.1:0\n"
      "  glasswing-solver --name solver-2 --listen 127.0.0.1:0 --archives /srv/glasswing\n"
      "  glasswing-solver solve out/archives/crystal crystal.exr --set modes=2\n"
      "  glasswing-solver mask vase.jpg empty.jpg mask.png");
  Work work;
  LogOptions logs;
  app.add_option("--server", work.server, "host:port of glasswing-server")->capture_default_str();
  app.add_option("--name", work.name,
                 "this node's name in the rig; of its host and its process, or Slurm's job, if left out");
  app.add_option("--until-idle", work.until_idle_seconds,
                 "end when there was nothing to do for so many seconds; 0: never")
      ->check(CLI::Range(0.0, 86400.0))
      ->capture_default_str();
  add_listen_options(
      app, work.listen,
      "to offer live mattes and copies of archives on, port 0: any free one; none if left out");
  app.add_option("--archives", work.archives,
                 "directory to keep copies of archives in, for `glasswing replicate`; none if left out");
  add_tls_options(app, work.tls);
  app.add_option("--threads", work.threads, "that solve; 0: one for each core")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  add_log_options(app, logs);
  add_metrics_option(app, work.metrics);
  app.set_version_flag("--version", kVersion);
  Solve here;
  CLI::App* solve_command = app.add_subcommand("solve", "Solve an archive on this machine, without a server");
  solve_command->footer("Options of method ramp:\n" + ramp_options_help());
  solve_command->add_option("archive", here.archive, "folder with manifest.json")->required();
  solve_command
      ->add_option("matte", here.matte,
                   "EXR file to write; a directory for a file a frame of a video (method ramp)")
      ->required();
  solve_command->add_option("--method", here.method, "how (docs/methods.md)")->capture_default_str();
  solve_command->add_option("--set", here.settings, "NAME=VALUE, an option of the method");
  solve_command->add_option("--threads", here.threads, "0: one for each core")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  MaskPictures pictures;
  const CLI::App& mask_command = add_mask_command(app, pictures);
  CLI11_PARSE(app, argc, argv);
  absl::Status status;
  if (solve_command->parsed()) {
    status = solve(here);
  } else if (mask_command.parsed()) {
    status = make_mask(pictures);
  } else {
    block_signals();
    start_logging("glasswing-solver", logs);
    status = serve(work);
  }
  if (!status.ok()) std::cerr << "glasswing-solver: " << status.message() << "\n";
  return status.ok() ? 0 : 1;
}
