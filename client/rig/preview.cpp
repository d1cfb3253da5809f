#include <fmt/format.h>

#include <filesystem>
#include <fstream>
#include <iostream>
#include <nlohmann/json.hpp>
#include <optional>

#include "client/cli/rpc.h"
#include "client/rig/commands.h"
#include "client/rig/shown_pattern.h"
#include "core/base/status.h"
#include "core/base/utf8.h"
#include "core/cli/output.h"
#include "core/cli/output_file.h"
#include "core/cli/progress.h"
#include "glasswing/v1/camera_service.grpc.pb.h"
#include "glasswing/v1/node_service.grpc.pb.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;
constexpr std::chrono::hours kPreviewTimeout(24);

struct PreviewArguments {
  std::string output = "live.jpg";
  double fps = 2.0;
  int width_px = 640;
  double exposure_ms = 0.0;
  std::string pattern;  // shown meanwhile; empty: none
  std::string camera;   // empty: the only one that is up
  int count = 0;        // 0: until interrupted
};

absl::StatusOr<std::string> camera_address(const Client& client, const std::string& name) {
  const Peer<v1::NodeService> server(client.server_title(), client.server);
  GW_ASSIGN_OR_RETURN(const v1::ListNodesResponse listed,
                      call_pages(server, &v1::NodeService::Stub::ListNodes, {}));
  std::vector<std::string> names;
  std::string address;
  for (const v1::Node& node : listed.nodes()) {
    if (node.kind() != v1::NODE_KIND_CAMERA || !node.up()) continue;
    if (node.name() == name) return node.address();
    names.push_back(node.name());
    address = node.address();
  }
  if (names.empty()) return absl::UnavailableError("no camera node is up; start glasswing-camera");
  if (name.empty() && names.size() == 1) return address;
  const std::string all = fmt::format("{}", fmt::join(names, ", "));
  if (!name.empty())
    return absl::UnavailableError(fmt::format("no camera node \"{}\" is up; there are: {}", name, all));
  return absl::FailedPreconditionError(
      fmt::format("the rig has several cameras, {}; name one with --camera", all));
}

// Replaces the file atomically, so that viewers never see a partial picture. Not flushed to disk. On standard
// output pictures follow one another.
absl::Status show_picture(const std::string& path, const std::string& bytes) {
  if (path == kStandardOutput) return write_output(path, bytes);
  const fs::path temporary = path + ".part";
  std::ofstream out(temporary, std::ios::binary);
  out.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  out.close();
  std::error_code error;
  if (out) fs::rename(temporary, path, error);
  if (out && !error) return absl::OkStatus();
  return cannot_write(path);
}

void print_line(const v1::PreviewResponse& shown, const PreviewArguments& arguments, bool json) {
  if (json) {
    const nlohmann::json line = {{"file", arguments.output},
                                 {"width_px", shown.width_px()},
                                 {"height_px", shown.height_px()},
                                 {"focus", shown.focus()},
                                 {"focus_hint", shown.focus_hint()},
                                 {"clipped_fraction", shown.clipped_fraction()},
                                 {"mean", shown.mean()},
                                 {"exposure_ms", shown.exposure_ms()}};
    std::cout << line.dump() << std::endl;
    return;
  }
  const std::string focus =
      shown.focus_hint().empty() ? fmt::format("focus {:.2f}", shown.focus()) : shown.focus_hint();
  std::cout << fmt::format("{} {}x{}: {:.2f} % clipped, mean {:.3f} at {:.3g} ms; {}", arguments.output,
                           shown.width_px(), shown.height_px(), 100.0 * shown.clipped_fraction(),
                           shown.mean(), shown.exposure_ms(), printable(focus))
            << std::endl;
}

// What the camera is doing before its first picture.
class Preparing {
 public:
  explicit Preparing(bool json) : json_(json) {}
  void show(const v1::Preparation& preparation) {
    if (json_) {
      nlohmann::json line = {{"preparation", preparation.what()}};
      if (preparation.has_done()) line["done"] = preparation.done();
      std::cout << line.dump() << std::endl;
      return;
    }
    if (preparation.what() != what_) {
      what_ = preparation.what();
      progress_.emplace(printable(what_));
    }
    if (preparation.has_done()) {
      progress_->update(preparation.done());
    } else {
      progress_->update_unknown();
    }
  }
  void end() {
    progress_.reset();
    what_.clear();
  }

 private:
  const bool json_;
  std::string what_;
  std::optional<Progress> progress_;
};

absl::Status preview(const Client& client, const PreviewArguments& arguments) {
  GW_ASSIGN_OR_RETURN(const std::string address, camera_address(client, arguments.camera));
  const Peer<v1::CameraService> camera("camera node at " + address, address);
  std::optional<ShownPattern> pattern;
  if (!arguments.pattern.empty()) {
    pattern.emplace(client, arguments.pattern, std::vector<std::string>());
    GW_RETURN_IF_ERROR(pattern->wait().status());
  }
  v1::PreviewRequest request;
  request.set_max_fps(arguments.fps);
  request.set_max_width_px(arguments.width_px);
  request.set_exposure_ms(arguments.exposure_ms);
  grpc::ClientContext context;
  set_deadline(context, kPreviewTimeout);
  const auto reader = camera.stub->Preview(&context, request);
  int shown = 0;
  absl::Status written;
  Preparing preparing(client.json);
  for (v1::PreviewResponse response; written.ok() && reader->Read(&response);) {
    if (response.has_preparation()) {
      preparing.show(response.preparation());
      continue;
    }
    preparing.end();
    written = show_picture(arguments.output, response.jpeg());
    if (written.ok()) print_line(response, arguments, client.json);
    if (++shown == arguments.count) break;
  }
  const bool enough = arguments.count > 0 && shown == arguments.count;
  if (enough || !written.ok()) context.TryCancel();
  const grpc::Status status = reader->Finish();
  GW_RETURN_IF_ERROR(written);
  if (enough) return absl::OkStatus();
  if (status.ok()) return absl::UnavailableError(camera.title + " has stopped");
  return status_from(status, camera.title);
}

}  // namespace

void add_preview_command(CLI::App& app, Client& client) {
  CLI::App& command = *app.add_subcommand(
      "preview", "Write the camera's live picture to a file, for framing and focus, until interrupted.");
  command.footer(
      "Focus is 0 to 1, whatever the exposure: 1 is an edge as sharp as the pixels, 0.5 one blurred by\n"
      "about a pixel.\n\n"
      "Examples:\n"
      "  glasswing preview -o live.jpg --fps 2\n"
      "  glasswing preview -o - | ffplay -f mjpeg -\n"
      "  glasswing preview --pattern lines");
  auto arguments = std::make_shared<PreviewArguments>();
  command.add_option("-o,--output", arguments->output, "the JPEG file to rewrite, or - for standard output")
      ->check(output_file({".jpg", ".jpeg", kStandardOutput}))
      ->capture_default_str();
  command.add_option("--fps", arguments->fps, "maximum frame rate, Hz")
      ->check(CLI::Range(0.2, 10.0))
      ->capture_default_str();
  command.add_option("--width", arguments->width_px, "maximum width, px")
      ->check(CLI::Range(16, 4096))
      ->capture_default_str();
  command
      .add_option("--exposure-ms", arguments->exposure_ms,
                  "exposure while no capture is running, ms; default: about 4")
      ->check(CLI::Range(0.01, 10000.0));
  command.add_option(
      "--pattern", arguments->pattern,
      "show this test pattern meanwhile: lines (to focus on), bars, white, gray, ramp or black; "
      "holds the rig");
  command.add_option("--camera", arguments->camera, "the camera node; needed if several are up")
      ->type_name("NODE");
  command.add_option("--count", arguments->count, "stop after this many pictures")
      ->check(CLI::Range(1, 1000000));
  command.callback(
      [&client, arguments] { client.run = [&client, arguments] { return preview(client, *arguments); }; });
}

}  // namespace glasswing
