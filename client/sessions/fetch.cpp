#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <iostream>
#include <nlohmann/json.hpp>
#include <optional>

#include "client/cli/camera_argument.h"
#include "client/cli/rpc.h"
#include "client/cli/session_text.h"
#include "client/sessions/commands.h"
#include "client/sessions/matte_input.h"
#include "core/base/status.h"
#include "core/base/utf8.h"
#include "core/cli/interrupt.h"
#include "core/cli/output.h"
#include "core/cli/output_file.h"
#include "core/cli/progress.h"
#include "core/file/file.h"
#include "core/file/positioned_file.h"
#include "core/matte/matte_notes.h"
#include "core/matte/packed_matte.h"
#include "core/pattern/draft_stages.h"
#include "glasswing/v1/queue_service.grpc.pb.h"
#include "glasswing/v1/session_service.grpc.pb.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

using Sessions = Peer<v1::SessionService>;

struct FetchArguments {
  std::string session, camera, output;
  std::optional<int> frame;
  std::optional<MatteRegion> region;
  bool partial = false, composite = false;
};

struct Fetched {
  MatteOutline outline;
  std::uint64_t bytes = 0;
  int unsolved_rows = 0;  // in which nothing is solved yet, or which saw the id patch
  PixelCount pixels;
};

absl::StatusOr<Fetched> verified(const PositionedFile& file) {
  Fetched fetched;
  GW_ASSIGN_OR_RETURN(fetched.bytes, file.size_bytes());
  GW_ASSIGN_OR_RETURN(const PackedMatteReader matte, PackedMatteReader::open(file));
  fetched.outline = matte.outline();
  GW_RETURN_IF_ERROR(matte.for_rows(0, matte.outline().height_px, [&](const Matte& rows) {
    fetched.pixels += count_pixels(rows);
    for (int y = 0; y < rows.height_px(); ++y) {
      bool solved = false;
      for (int x = 0; x < rows.width_px() && !solved; ++x) solved = (rows.flags(x, y) & kFlagNoData) == 0;
      if (!solved) ++fetched.unsolved_rows;
    }
    return absl::OkStatus();
  }));
  return fetched;
}

// Writes a matte to a file as it arrives: it is never completely in memory.
absl::StatusOr<Fetched> fetched(const Sessions& server, const v1::FetchMatteRequest& request,
                                const fs::path& path, Waiting* waiting = nullptr) {
  UnfinishedFile unfinished(path);
  GW_ASSIGN_OR_RETURN(FileWriter writer, FileWriter::create(unfinished.path()));
  GW_RETURN_IF_ERROR(stream_matte(server, request, writer, waiting));
  GW_ASSIGN_OR_RETURN(const PositionedFile file, PositionedFile::open(unfinished.path()));
  absl::StatusOr<Fetched> matte = verified(file);
  if (!matte.ok()) {
    return absl::Status(matte.status().code(),
                        fmt::format("the matte of {}session {} arrived damaged: {}",
                                    request.has_frame() ? fmt::format("frame {} of ", request.frame()) : "",
                                    request.name(), std::string(matte.status().message())));
  }
  GW_RETURN_IF_ERROR(unfinished.finish());
  return matte;
}

v1::FetchMatteRequest request_of(const FetchArguments& arguments) {
  v1::FetchMatteRequest request;
  request.set_name(arguments.session);
  if (arguments.frame) request.set_frame(*arguments.frame);
  request.set_partial(arguments.partial);
  if (arguments.region) {
    request.mutable_region()->set_x_px(arguments.region->x_px);
    request.mutable_region()->set_y_px(arguments.region->y_px);
    request.mutable_region()->set_width_px(arguments.region->width_px);
    request.mutable_region()->set_height_px(arguments.region->height_px);
  }
  return request;
}

absl::StatusOr<Fetched> fetched_to_file(const Sessions& server, const FetchArguments& arguments) {
  Waiting waiting("fetching");
  GW_ASSIGN_OR_RETURN(Fetched whole, fetched(server, request_of(arguments), arguments.output, &waiting));
  // Only a partial matte has rows that are not solved yet: in a finished one, rows without a solved pixel are
  // those that see the id patch.
  if (!arguments.partial) whole.unsolved_rows = 0;
  return whole;
}

nlohmann::ordered_json json_of(const v1::Draft& draft) {
  return {{"images", draft.image_count()},
          {"planned_images", draft.planned_image_count()},
          {"sweeps", draft.sweep_count()},
          {"planned_sweeps", draft.planned_sweep_count()}};
}

absl::Status fetch_file(const Client& client, const Sessions& server, const FetchArguments& arguments) {
  GW_RETURN_IF_ERROR(check_output_file(arguments.output, {".exr", kStandardOutput}));
  GW_ASSIGN_OR_RETURN(const Fetched whole, fetched_to_file(server, arguments));
  const MatteOutline& matte = whole.outline;
  if (client.json) {
    nlohmann::ordered_json written = {{"session", arguments.session}, {"file", arguments.output},
                                      {"bytes", whole.bytes},         {"width_px", matte.width_px},
                                      {"height_px", matte.height_px}, {"x_px", matte.x0_px},
                                      {"y_px", matte.y0_px},          {"unsolved_rows", whole.unsolved_rows}};
    if (matte.metadata.has_draft()) written["draft"] = json_of(matte.metadata.draft());
    add_notes(warnings_of(matte.metadata), whole.pixels, written);
    std::cout << written.dump(1) << "\n";
  } else {
    std::cout << fmt::format("{}: the matte of session {}, {}x{}{}\n", arguments.output, arguments.session,
                             matte.width_px, matte.height_px,
                             arguments.region
                                 ? fmt::format("+{}+{} of {}x{}", matte.x0_px, matte.y0_px,
                                               matte.metadata.width_px(), matte.metadata.height_px())
                                 : "");
    if (matte.metadata.has_draft())
      std::cout << describe(matte.metadata.draft()) << "; the others are not captured yet, or not solved\n";
    if (whole.unsolved_rows > 0)
      std::cout << fmt::format("{} of its {} rows are not solved yet\n", whole.unsolved_rows,
                               matte.height_px);
    print_flagged(whole.pixels);
    for (const std::string& warning : matte.metadata.warnings())
      std::cout << fmt::format("warning: {}\n", printable(warning));
  }
  return absl::OkStatus();
}

// True if the file is the last solve's matte of this frame and region; an older solve may have left another.
bool is_there(const fs::path& path, const v1::Session& session, int frame,
              const std::optional<MatteRegion>& region) {
  const absl::StatusOr<PositionedFile> file = PositionedFile::open(path);
  const absl::StatusOr<Fetched> matte = file.ok() ? verified(*file) : file.status();
  if (!matte.ok()) return false;
  const MatteOutline& outline = matte->outline;
  const v1::MatteMetadata& made = outline.metadata;
  const MatteRegion wanted = region.value_or(
      MatteRegion{.x_px = 0, .y_px = 0, .width_px = made.width_px(), .height_px = made.height_px()});
  const MatteRegion has{outline.x0_px, outline.y0_px, outline.width_px, outline.height_px};
  return made.session() == session.name() && made.method() == session.method() && made.frame() == frame &&
         has == wanted &&
         std::map<std::string, std::string>(made.options().begin(), made.options().end()) ==
             std::map<std::string, std::string>(session.options().begin(), session.options().end());
}

// Mattes come from the last finished solve, but the session describes the last solve. True if both are the
// same.
bool describes_mattes(const v1::Session& session) {
  return session.state() == v1::SESSION_STATE_DONE || !session.matte_ready();
}

struct Frames {
  int fetched = 0, there_before = 0;
  std::vector<std::string> warnings;
};

absl::StatusOr<Frames> fetch_frames(const Sessions& server, const v1::Session& session,
                                    const FetchArguments& arguments) {
  const fs::path directory = arguments.output;
  Frames frames;
  Progress progress("fetching");
  const Interruptible ctrl_c;
  const int count = session.solved_frames_size();
  for (int i = 0; i < count; ++i) {
    if (interrupted()) {
      return absl::CancelledError(
          fmt::format("{} of {} mattes are in {}; the same command again fetches the rest", i, count,
                      directory.string()));
    }
    const int frame = session.solved_frames(i);
    const fs::path path = directory / fmt::format("{:04d}.exr", frame);
    if (describes_mattes(session) && is_there(path, session, frame, arguments.region)) {
      ++frames.there_before;
    } else {
      FetchArguments one = arguments;
      one.frame = frame;
      GW_ASSIGN_OR_RETURN(const Fetched whole, fetched(server, request_of(one), path));
      ++frames.fetched;
      note_warnings(whole.outline.metadata, frames.warnings);
    }
    progress.update((i + 1.0) / count, fmt::format("{} of {} frames", i + 1, count));
  }
  progress.done(fmt::format("{} frames", count));
  return frames;
}

google::protobuf::RepeatedField<std::int32_t> unsolved_frames(const v1::Session& session) {
  const auto has = [](const auto& rising, int frame) {
    return std::binary_search(rising.begin(), rising.end(), frame);
  };
  google::protobuf::RepeatedField<std::int32_t> unsolved;
  for (int frame = 0; frame < session.frame_count(); ++frame) {
    if (!has(session.solved_frames(), frame) && !has(session.lost_frames(), frame)) unsolved.Add(frame);
  }
  return unsolved;
}

absl::Status fetch_video(const Client& client, const Sessions& server, const v1::Session& session,
                         const FetchArguments& arguments) {
  const fs::path directory = arguments.output;
  GW_RETURN_IF_ERROR(make_directory_durably(directory));
  GW_ASSIGN_OR_RETURN(const Frames frames, fetch_frames(server, session, arguments));
  const auto unsolved = unsolved_frames(session);
  if (client.json) {
    const nlohmann::ordered_json written = {
        {"session", session.name()},
        {"directory", directory.string()},
        {"fetched", frames.fetched},
        {"there_before", frames.there_before},
        {"lost", std::vector<int>(session.lost_frames().begin(), session.lost_frames().end())},
        {"not_solved", std::vector<int>(unsolved.begin(), unsolved.end())},
        {"warnings", frames.warnings}};
    std::cout << written.dump(1) << "\n";
  } else {
    std::cout << fmt::format(
        "{}: mattes of {} of {} frames of session {}{}\n", directory.string(), session.solved_frames_size(),
        session.frame_count(), session.name(),
        frames.there_before > 0 ? fmt::format("; {} were there before", frames.there_before) : "");
    if (!session.lost_frames().empty())
      std::cout << fmt::format("lost, not captured: frames {}\n", ranges_text(session.lost_frames()));
    for (const std::string& warning : frames.warnings)
      std::cout << fmt::format("warning: {}\n", printable(warning));
  }
  if (unsolved.empty()) return absl::OkStatus();
  return absl::FailedPreconditionError(fmt::format("{} frames are not solved: {}; {}", unsolved.size(),
                                                   ranges_text(unsolved), summary_of(session)));
}

absl::Status fetch_composite(const Client& client, const FetchArguments& arguments) {
  GW_RETURN_IF_ERROR(check_output_file(arguments.output, {".exr", kStandardOutput}));
  const Peer<v1::QueueService> server(client.server_title(), client.server);
  UnfinishedFile unfinished(arguments.output);
  GW_ASSIGN_OR_RETURN(FileWriter writer, FileWriter::create(unfinished.path()));
  v1::FetchCompositeRequest request;
  request.set_session(arguments.session);
  grpc::ClientContext context;
  set_deadline(context, kLongCallTimeout);
  const auto reader = server.stub->FetchComposite(&context, request);
  absl::Status written;
  std::uint64_t bytes = 0;
  for (v1::FetchCompositeResponse response; written.ok() && reader->Read(&response);) {
    written = writer.add(response.chunk());
    bytes += response.chunk().size();
  }
  if (!written.ok()) context.TryCancel();
  const grpc::Status status = reader->Finish();
  GW_RETURN_IF_ERROR(written);
  if (!status.ok()) return status_from(status, server.title);
  GW_RETURN_IF_ERROR(unfinished.finish());
  if (client.json) {
    const nlohmann::ordered_json json = {
        {"session", arguments.session}, {"file", arguments.output}, {"bytes", bytes}};
    std::cout << json.dump(1) << "\n";
  } else {
    std::cout << fmt::format("{}: the composite of session {}\n", arguments.output, arguments.session);
  }
  return absl::OkStatus();
}

absl::Status fetch_one(const Client& client, const Sessions& server, const v1::Session& session,
                       const FetchArguments& arguments) {
  if (arguments.composite) return fetch_composite(client, arguments);
  if (arguments.frame || arguments.partial) return fetch_file(client, server, arguments);
  const bool to_directory = arguments.output.ends_with('/') || fs::is_directory(arguments.output);
  const bool frames = describes_mattes(session) ? is_video(session) : !session.solved_frames().empty();
  if (frames) {
    if (to_directory || (!fs::path(arguments.output).has_extension() && arguments.output != kStandardOutput))
      return fetch_video(client, server, session, arguments);
    return absl::InvalidArgumentError(
        fmt::format("session {} is a video of {} frames; -o is {}: it must be a directory (end a new one in "
                    "/), or select "
                    "one frame with --frame",
                    arguments.session, session.frame_count(), arguments.output));
  }
  FetchArguments still = arguments;
  if (to_directory) {
    GW_RETURN_IF_ERROR(make_directory_durably(arguments.output));
    still.output = (fs::path(arguments.output) / "0000.exr").string();
  }
  return fetch_file(client, server, still);
}

// "vase.exr" for camera left: "vase.left.exr"; "vase/": "vase/left", with the ending of what is written
// there.
std::string output_of(const std::string& output, const v1::Session& view) {
  if (output.ends_with('/') || fs::is_directory(output))
    return (fs::path(output) / view.view_camera()).string() + (is_video(view) ? "/" : ".exr");
  fs::path path(output);
  return path.replace_extension(view.view_camera() + path.extension().string()).string();
}

absl::Status fetch(const Client& client, const FetchArguments& arguments) {
  const Sessions server(client.server_title(), client.server);
  GW_ASSIGN_OR_RETURN(const v1::Session session, session_of(client, arguments.session, arguments.camera));
  if (!session.views().empty() && arguments.output == kStandardOutput) {
    return absl::InvalidArgumentError(
        fmt::format("session {} has {} cameras, and -o is - for one matte; name a camera: --camera {}",
                    session.name(), session.views_size(), session.views(0).view_camera()));
  }
  for (const v1::Session& view : session.views()) {
    FetchArguments own = arguments;
    own.session = view.name();
    own.output = output_of(arguments.output, view);
    GW_RETURN_IF_ERROR(fetch_one(client, server, view, own));
  }
  if (!session.views().empty()) return absl::OkStatus();
  FetchArguments own = arguments;
  own.session = session.name();
  return fetch_one(client, server, session, own);
}

}  // namespace

void add_fetch_command(CLI::App& app, Client& client) {
  CLI::App& command = *app.add_subcommand("fetch", "Fetch a matte, or the mattes of a video.");
  command.footer(
      "The solved frames of a video become 0000.exr, 0001.exr, ... in a directory; existing files are not "
      "fetched again. Of several cameras, vase.exr becomes vase.left.exr and so on.\n\n"
      "Examples:\n"
      "  glasswing fetch vase -o vase.exr\n"
      "  glasswing fetch vase -o rim.exr --crop 640x480+1200+300\n"
      "  glasswing fetch vase -o so-far.exr --partial\n"
      "  glasswing fetch vase -o left.exr --camera left\n"
      "  glasswing fetch vase -o vase-harbour.exr --composite\n"
      "  glasswing fetch pouring -o pouring/\n"
      "  glasswing fetch pouring --frame 7 -o pouring-7.exr");
  auto arguments = std::make_shared<FetchArguments>();
  auto crop = std::make_shared<std::string>();
  command.add_option("session", arguments->session, "the session's name")->required();
  command
      .add_option("-o,--output", arguments->output,
                  "the OpenEXR file to write, or - for standard output; for a video, the directory")
      ->required();
  add_view_option(command, arguments->camera);
  command.add_option("--frame", arguments->frame, "fetch only this frame of a video, counted from 0")
      ->check(CLI::Range(0, 17999));
  command
      .add_flag("--partial", arguments->partial,
                "fetch the newest draft of a session that is being captured or solved, or what is solved so "
                "far, also after a failed solve; the rest is flagged \"not solved\"")
      ->excludes("--frame");
  command
      .add_option("--crop", *crop,
                  "WIDTHxHEIGHT+X+Y: fetch only this region, px from the picture's top-left corner")
      ->check([](const std::string& text) { return std::string(parse_region(text).status().message()); });
  command
      .add_flag("--composite", arguments->composite,
                "fetch the composite that an item of the queue made of it (queue add --background)")
      ->excludes("--frame")
      ->excludes("--partial")
      ->excludes("--crop");
  command.callback([&client, arguments, crop] {
    if (!crop->empty()) arguments->region = parse_region(*crop).value();
    client.run = [&client, arguments] { return fetch(client, *arguments); };
  });
}

}  // namespace glasswing
