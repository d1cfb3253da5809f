#include <fmt/format.h>

#include <algorithm>
#include <iostream>
#include <nlohmann/json.hpp>

#include "client/cli/rpc.h"
#include "client/cli/session_text.h"
#include "client/exchange/commands.h"
#include "client/exchange/frame_source.h"
#include "client/exchange/layout_list.h"
#include "client/exchange/partial_directory.h"
#include "compositing/picture/video_file.h"
#include "core/base/checksum.h"
#include "core/base/name.h"
#include "core/base/status.h"
#include "core/base/utf8.h"
#include "core/cli/interrupt.h"
#include "core/cli/output.h"
#include "core/cli/output_file.h"
#include "core/cli/progress.h"
#include "core/file/file.h"
#include "core/frame/archive.h"
#include "core/import/sequences.h"
#include "glasswing/v1/archive_service.grpc.pb.h"
#include "glasswing/v1/session_service.grpc.pb.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

// Files that are passed on unchanged are verified during the transfer.
absl::Status verify(const FrameSource& source) {
  if (source.was_read || source.pass_on) return absl::OkStatus();
  Progress progress("checking");
  const int count = source.manifest.frames_size();
  for (int i = 0; i < count; ++i) {
    if (interrupted()) return absl::CancelledError("the import was interrupted before anything was written");
    GW_RETURN_IF_ERROR(source.read(i).status());
    progress.update((i + 1.0) / count, fmt::format("{} of {} frames", i + 1, count));
  }
  return source.check ? source.check() : absl::OkStatus();
}

// Passes on the bytes of a frame's file.
using Bytes = std::function<absl::Status(const TakeBytes&)>;

// Sends frames in batches: one call each, whose frames are durable once it returns.
class FrameSender {
 public:
  FrameSender(const Peer<v1::ArchiveService>& archive, std::string session)
      : archive_(archive), session_(std::move(session)) {}
  ~FrameSender() {
    if (call_ == nullptr) return;
    call_->context.TryCancel();
    (void)call_->writer->Finish();
  }
  FrameSender(const FrameSender&) = delete;
  FrameSender& operator=(const FrameSender&) = delete;

  absl::Status add(const v1::Frame& frame, const Bytes& bytes) {
    constexpr std::int64_t kBatchBytes = 64 << 20;
    constexpr int kBatchFrames = 1000;
    if (call_ != nullptr &&
        (call_->frames == kBatchFrames || call_->size_bytes + frame.size_bytes() > kBatchBytes))
      GW_RETURN_IF_ERROR(finish());
    if (call_ == nullptr) call_ = std::make_unique<Call>(*archive_.stub);
    call_->frames += 1;
    call_->size_bytes += frame.size_bytes();
    message_.Clear();
    message_.set_session(session_);
    *message_.mutable_frame() = frame;
    GW_RETURN_IF_ERROR(send());
    message_.Clear();
    return bytes([&](std::string_view piece) {
      for (; !piece.empty(); piece.remove_prefix(std::min(kChunkBytes, piece.size()))) {
        message_.set_chunk(piece.data(), std::min(kChunkBytes, piece.size()));
        GW_RETURN_IF_ERROR(send());
      }
      return absl::OkStatus();
    });
  }
  absl::Status finish() {
    if (call_ == nullptr) return absl::OkStatus();
    call_->writer->WritesDone();
    const grpc::Status status = std::exchange(call_, nullptr)->writer->Finish();
    return status.ok() ? absl::OkStatus() : status_from(status, archive_.title);
  }

 private:
  struct Call {
    explicit Call(v1::ArchiveService::Stub& stub) {
      set_deadline(context, std::chrono::minutes(5));
      writer = stub.PutFrame(&context, &stored);
    }
    grpc::ClientContext context;
    v1::PutFrameResponse stored;
    std::unique_ptr<grpc::ClientWriter<v1::PutFrameRequest>> writer;
    int frames = 0;
    std::int64_t size_bytes = 0;
  };

  absl::Status send() {
    if (call_->writer->Write(message_)) return absl::OkStatus();
    GW_RETURN_IF_ERROR(finish());  // has the reason
    return absl::InternalError(fmt::format("the {} ended the call early", archive_.title));
  }

  const Peer<v1::ArchiveService>& archive_;
  const std::string session_;
  std::unique_ptr<Call> call_;  // null between batches
  v1::PutFrameRequest message_;
};

// Stores a frame: its record, and the bytes of its file.
using Store = std::function<absl::Status(const v1::Frame&, const Bytes&)>;

// `broken_off`: the error after Ctrl-C, which says what remains.
absl::Status store_frames(const FrameSource& source, const std::string& broken_off, const Store& store) {
  // Frames of foreign archives are renamed by their index.
  const bool own_names = std::ranges::all_of(source.manifest.frames(), is_stored_frame);
  Progress progress("importing");
  const int count = source.manifest.frames_size();
  for (int i = 0; i < count; ++i) {
    if (interrupted()) return absl::CancelledError(broken_off);
    v1::Frame frame = source.manifest.frames(i);
    if (source.pass_on) {
      GW_RETURN_IF_ERROR(store(frame, [&](const TakeBytes& take) { return source.pass_on(i, take); }));
    } else {
      GW_ASSIGN_OR_RETURN(const Image16 image, source.read(i));
      const std::string tiff = encode_tiff(image, FrameForm::kCompressed);
      if (!own_names) frame.set_file(fmt::format("frames/{:06d}.tif", i));
      frame.set_checksum(checksum_of(tiff));
      frame.set_size_bytes(static_cast<std::int64_t>(tiff.size()));
      GW_RETURN_IF_ERROR(store(frame, [&](const TakeBytes& take) { return take(tiff); }));
    }
    progress.update((i + 1.0) / count, fmt::format("{} of {} frames", i + 1, count));
  }
  progress.done(fmt::format("{} frames", count));
  return absl::OkStatus();
}

// The last part of the path, whether or not it ends in a slash.
std::string name_of_directory(const fs::path& directory) {
  const fs::path normal = fs::weakly_canonical(directory);
  return (normal.has_filename() ? normal : normal.parent_path()).filename().string();
}

struct ImportArguments {
  std::string directory;
  std::string session;
  std::string camera;
  std::string archive;  // empty: the server's
  std::string list;
  LayoutOptions layout;
  std::string files;  // a glob, with a layout
  std::string sequence;
  VideoOptions video;
};

// True for a folder of numbered pictures without a manifest.
bool is_video_folder(const fs::path& path) {
  return !fs::exists(path / "manifest.json") && !numbered_pictures(path).empty();
}

absl::StatusOr<FrameSource> source_of(const ImportArguments& arguments) {
  const fs::path path = arguments.directory;
  const PhotographOptions& photographs = arguments.video.photographs;
  if (!arguments.list.empty()) {
    GW_ASSIGN_OR_RETURN(PhotographList list, read_photograph_list(arguments.list, photographs));
    return photograph_source(path, std::move(list));
  }
  if (!arguments.layout.layout.empty()) {
    GW_ASSIGN_OR_RETURN(LaidOutList laid_out,
                        list_by_layout(path, arguments.files, arguments.layout, photographs));
    return photograph_source(path, std::move(laid_out.list), std::move(laid_out.samples));
  }
  if (is_video_file(path) || (arguments.sequence.empty() && is_video_folder(path)))
    return video_source(path, arguments.video);
  if (!photographs.monitors.empty() || photographs.response || photographs.black || photographs.white ||
      arguments.video.empty_frames != 0 || !arguments.video.empty_directory.empty()) {
    return absl::InvalidArgumentError(
        fmt::format("{} is an archive; --monitor, --response, --black, --white, --empty-frames and --empty "
                    "are for photographs "
                    "and videos",
                    path.string()));
  }
  return arguments.sequence.empty() ? archive_source(path) : sequence_source(path, arguments.sequence);
}

absl::Status send(const Client& client, const FrameSource& source, const std::string& camera) {
  GW_RETURN_IF_ERROR(verify(source));
  const std::string& name = source.manifest.session();
  const Peer<v1::SessionService> server(client.server_title(), client.server);
  v1::BeginImportRequest begin;
  begin.set_name(name);
  *begin.mutable_manifest() = source.manifest;
  begin.mutable_manifest()->clear_frames();
  begin.set_camera(camera);
  GW_ASSIGN_OR_RETURN(const v1::BeginImportResponse begun,
                      call(server, &v1::SessionService::Stub::BeginImport, begin, kLongCallTimeout));
  const std::string& address = begun.session().archive_address();
  const Peer<v1::ArchiveService> archive("camera node at " + address, address);
  const std::string broken_off =
      fmt::format("session {} is incomplete; repeat the command to complete it", name);
  FrameSender sender(archive, name);
  GW_RETURN_IF_ERROR(store_frames(source, broken_off, [&](const v1::Frame& frame, const Bytes& bytes) {
    return sender.add(frame, bytes);
  }));
  GW_RETURN_IF_ERROR(sender.finish());
  v1::FinishImportRequest finish;
  finish.set_name(name);
  GW_ASSIGN_OR_RETURN(const v1::FinishImportResponse finished,
                      call(server, &v1::SessionService::Stub::FinishImport, finish, kLongCallTimeout));
  print_session(finished.session(), client.json);
  return absl::OkStatus();
}

absl::Status write(const Client& client, const FrameSource& source, const std::string& directory) {
  GW_ASSIGN_OR_RETURN(const std::unique_ptr<PartialDirectory> partial, PartialDirectory::create(directory));
  GW_RETURN_IF_ERROR(verify(source));
  v1::CaptureManifest manifest = source.manifest;
  manifest.clear_frames();
  const std::string broken_off = "the import was interrupted; nothing of it is kept";
  FlushQueue flushing;
  const Store store = [&](const v1::Frame& frame, const Bytes& bytes) -> absl::Status {
    *manifest.add_frames() = frame;
    GW_ASSIGN_OR_RETURN(FileWriter file, FileWriter::create(partial->path() / frame.file()));
    GW_RETURN_IF_ERROR(bytes([&](std::string_view piece) { return file.add(piece); }));
    flushing.add(std::move(file));
    return absl::OkStatus();
  };
  GW_RETURN_IF_ERROR(store_frames(source, broken_off, store));
  GW_RETURN_IF_ERROR(flushing.wait());
  GW_RETURN_IF_ERROR(partial->keep(manifest));
  if (client.json) {
    const nlohmann::ordered_json written = {
        {"session", manifest.session()}, {"directory", directory}, {"frames", manifest.frames_size()}};
    std::cout << written.dump(1) << "\n";
  } else {
    std::cout << fmt::format("{}: {} frames\n", directory, manifest.frames_size());
  }
  return absl::OkStatus();
}

absl::Status import(const Client& client, const ImportArguments& arguments) {
  const Interruptible ctrl_c;
  GW_ASSIGN_OR_RETURN(FrameSource source, source_of(arguments));
  const std::string& named_after = arguments.archive.empty() ? arguments.directory : arguments.archive;
  source.manifest.set_session(arguments.session.empty() ? name_of_directory(named_after) : arguments.session);
  GW_RETURN_IF_ERROR(check_name("session", source.manifest.session()));
  GW_RETURN_IF_ERROR(arguments.archive.empty() ? send(client, source, arguments.camera)
                                               : write(client, source, arguments.archive));
  for (const std::string& warning : source.warnings)
    std::cerr << fmt::format("warning: {}\n", printable(warning));
  return absl::OkStatus();
}

}  // namespace

void add_layout_options(CLI::App& command, const std::shared_ptr<ImportArguments>& arguments) {
  LayoutOptions& options = arguments->layout;
  CLI::Option* layout =
      command
          .add_option("--layout", options.layout,
                      "the photographs, in natural order of their names (2 before 10), show these patterns: "
                      "opencv-graycode, binary, phase-shift; auto detects the layout from the pictures, and "
                      "says why")
          ->excludes("--list")
          ->excludes("--sequence")
          ->excludes("--empty-frames")
          ->excludes("--empty");
  const auto add = [&](const char* name, auto& value, const char* help) {
    command.add_option(name, value, help)->needs(layout);
  };
  add("--files", arguments->files,
      "a layout's photographs: a glob pattern below the directory, such as 'left*' or '*/cam0_*'; default: "
      "all pictures in the directory itself");
  add("--order", options.order,
      "the order of a layout's parts; default: columns,rows,white,black, or columns,rows for phase-shift. "
      "Columns are vertical bars; fringes beside a code are fringe-columns and fringe-rows");
  add("--inverse", options.inverse,
      "where the complement of each pattern is: after it, before it, or none; default: after for "
      "opencv-graycode, none for binary");
  add("--cell", options.cell_px, "the width of a code's cells, px; default: 1");
  add("--steps", options.steps, "photographs per fringe period, 3 to 64");
  add("--periods", options.periods,
      "number of fringes along a side of the monitor, such as 1,8,64; or their lengths, such as "
      "1920px,120px");
  add("--shift", options.shift,
      "forward if fringes move towards larger x and y from step to step, otherwise backward; default: "
      "forward");
  add("--phase", options.phase_deg, "the phase of the first step of fringes, degrees; default: 0");
}

constexpr char kImportFooter[] =
    "Every frame is checked before the first is sent; frames of an archive by their headers and sizes, "
    "and\n"
    "their checksums while they are sent. An interrupted import can be repeated.\n\n"
    "A layout defines what the photographs of a folder show, by their order. Photographs do not show the "
    "monitor's size: --layout needs\n"
    "--monitor. A list has one photograph per line with what the monitor showed: tab-separated values with "
    "a header\n"
    "row: file, object (true or false), kind, and further fields of the stimulus (docs/archive.md):\n\n"
    "  #monitor back:1920x1080\n"
    "  #response srgb\n"
    "  file\tobject\tkind\torient\tbar_width_px\tcolour\n"
    "  IMG_1.jpg\ttrue\tsolid\t\t\t0,0,0\n"
    "  IMG_2.jpg\ttrue\tsquare\tvertical_bars\t960\t\n\n"
    "If neither the list nor --response gives the response of the codes, it is estimated from the\n"
    "photographs, with a warning, or required.\n\n"
    "A video of the ramp is a video file, or a directory of pictures whose names end in a number. It "
    "needs\n"
    "--monitor, and frames of the empty stage: --empty-frames or --empty.\n\n"
    "Examples:\n"
    "  glasswing import archives/vase --session vase\n"
    "  glasswing import archives/pouring --sequence ramp_dark --session pouring\n"
    "  glasswing import clip.mp4 --monitor back:1920x1080 --empty-frames 60 --session pouring\n"
    "  glasswing import scan --layout auto --monitor 1024x768 --session vase\n"
    "  glasswing import scan --layout opencv-graycode --monitor 1024x768 --archive archives/vase\n"
    "  glasswing import scan --layout binary --order white,rows,columns --monitor 512x512 --response srgb\n"
    "  glasswing import scan --layout phase-shift --steps 4 --periods 1,8,64 --monitor 1920x1080 --session "
    "mirror\n"
    "  glasswing import photographs --list photographs/list.tsv --session vase\n"
    "  glasswing import photographs --list photographs/list.tsv --archive archives/vase";

void add_import_command(CLI::App& app, Client& client) {
  CLI::App& command =
      *app.add_subcommand("import", "Import an archive, photographs or a video as a session.");
  command.footer(kImportFooter);
  auto arguments = std::make_shared<ImportArguments>();
  command
      .add_option(
          "directory", arguments->directory,
          "a session archive (manifest.json and frames), a directory of photographs (also raw files), or a "
          "video (a file or pictures)")
      ->required();
  command.add_option("--session", arguments->session, "the session's name; default: the directory's");
  command
      .add_option("--camera", arguments->camera,
                  "the camera node to store the frames; needed if several are up")
      ->type_name("NODE");
  command
      .add_option("--archive", arguments->archive,
                  "write an archive to this new or empty directory instead of calling a server")
      ->check(output_directory());
  CLI::Option* list = command.add_option("--list", arguments->list, "the photographs' list");
  command
      .add_option("--sequence", arguments->sequence,
                  "import one of the archive's sequences, with its backgrounds")
      ->excludes(list);
  command
      .add_option("--empty-frames", arguments->video.empty_frames,
                  "number of frames at a video's start that show the empty stage")
      ->check(CLI::Range(1, 18000));
  command
      .add_option("--empty", arguments->video.empty_directory,
                  "or a directory of pictures of the empty stage")
      ->excludes("--empty-frames");
  command
      .add_option(
          "--monitor", arguments->video.photographs.monitors,
          "NAME:WIDTHxHEIGHT, or WIDTHxHEIGHT, in px: a layout's or a video's monitor, or one that replaces "
          "the list's; may be repeated")
      ->allow_extra_args(false);
  command.add_option("--response", arguments->video.photographs.response,
                     "light of the pictures' codes: srgb, linear, or gamma:G for (code / highest code)^G, or "
                     "unknown; default: estimated for photographs, srgb for videos");
  command.add_option("--black", arguments->video.photographs.black,
                     "the pictures' code without light; default: 0");
  command
      .add_option("--white", arguments->video.photographs.white,
                  "the highest code that the camera writes, such as 1023 for 10-bit codes in 16-bit files; "
                  "default: the files' own, 255 or 65535")
      ->check(CLI::Range(1, 65535));
  add_layout_options(command, arguments);
  command.callback(
      [&client, arguments] { client.run = [&client, arguments] { return import(client, *arguments); }; });
}

}  // namespace glasswing
