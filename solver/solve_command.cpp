#include "solver/solve_command.h"

#include <absl/strings/numbers.h>
#include <absl/strings/str_split.h>
#include <fmt/format.h>
#include <unistd.h>

#include <filesystem>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/base/status.h"
#include "core/cli/help.h"
#include "core/file/file.h"
#include "core/import/mapped_archive.h"
#include "core/matte/matte_file.h"
#include "core/matte/matte_notes.h"
#include "core/matte/row_part.h"
#include "core/method/methods.h"
#include "core/pattern/plan.h"
#include "solver/methods.h"
#include "solver/ramp/video_layout.h"
#include "solver/worker/parallel_solve.h"
#include "solver/worker/vector_target.h"
#include "solver/worker/video_solve.h"

namespace glasswing {
namespace {

struct Solve {
  std::string archive, matte, rows, method = "gaussian";
  std::vector<std::string> settings;
  int threads = 0;
  bool as_recorded = false, json = false;
};

// Part `number` of `of` equal ones.
struct Share {
  int number = 1, of = 1;
};

absl::StatusOr<std::optional<Share>> share_of(const std::string& text) {
  if (text.empty()) return std::nullopt;
  const std::pair<std::string, std::string> words = absl::StrSplit(text, absl::MaxSplits('/', 1));
  Share share;
  if (absl::SimpleAtoi(words.first, &share.number) && absl::SimpleAtoi(words.second, &share.of) &&
      share.number >= 1 && share.number <= share.of)
    return share;
  return absl::InvalidArgumentError(
      fmt::format("--rows is \"{}\"; it must be K/N, part K of N, such as 3/8 with K from 1 to N", text));
}

// The part's share of `count` rows, or frames.
absl::StatusOr<RowRange> range_of(const Share& share, int count, std::string_view what) {
  if (share.of > count) {
    return absl::InvalidArgumentError(
        fmt::format("--rows is {}/{}; the archive has {} {}, so that N must be 1 to {}", share.number,
                    share.of, count, what, count));
  }
  const auto begin_of = [&](int number) {
    return static_cast<int>(std::int64_t{count} * (number - 1) / share.of);
  };
  const int first = begin_of(share.number);
  return RowRange{.first = first, .count = begin_of(share.number + 1) - first};
}

// What there is to say of the mattes that were written.
struct Solved {
  std::vector<std::string> warnings;
  PixelCount pixels;
  std::optional<int> frames;  // of a video

  void note(const Matte& matte) {
    note_warnings(matte.metadata, warnings);
    pixels += count_pixels(matte);
  }
};

void print(const Solve& solve, const Solved& solved) {
  print_warnings(solved.warnings);
  if (!solve.json) {
    print_flagged(solved.pixels);
    return;
  }
  nlohmann::ordered_json written{{"archive", solve.archive}, {"matte", solve.matte}};
  if (solved.frames) written["frames"] = *solved.frames;
  add_notes(solved.warnings, solved.pixels, written);
  std::cout << written.dump(1) << "\n";
}

// Writes a matte per frame: 0000.exr and so on. Goes on past frames that cannot be solved, and returns the
// first of their errors.
absl::Status solve_each_frame(const VideoMethod& method, const MappedArchive& archive, const Solve& solve,
                              const Share& share) {
  const v1::CaptureManifest& manifest = archive.manifest();
  GW_ASSIGN_OR_RETURN(const VideoLayout layout, lay_out_video(manifest));
  GW_ASSIGN_OR_RETURN(const RowRange frames,
                      range_of(share, static_cast<int>(layout.frames.size()), "frames"));
  const ReadFrame read = [&](int frame) -> absl::StatusOr<std::vector<std::uint16_t>> {
    GW_ASSIGN_OR_RETURN(const FrameSamples whole, archive.read(frame, 0, manifest.camera().height_px()));
    return std::vector<std::uint16_t>(whole.samples.begin(), whole.samples.end());
  };
  GW_ASSIGN_OR_RETURN(const std::unique_ptr<VideoSource> source,
                      read_ahead(manifest, frames.first, frames.count, read));
  std::error_code failed;
  std::filesystem::create_directories(solve.matte, failed);
  if (failed)
    return absl::InvalidArgumentError(
        fmt::format("{}: it must be a directory: {}", solve.matte, failed.message()));
  const bool watched = ::isatty(STDERR_FILENO) != 0;
  absl::Status refused;  // the first of them
  Solved solved{.warnings = {}, .pixels = {}, .frames = 0};
  const absl::Status status = solve_video(
      method, *source, frames.first, frames.count, solve.threads, {},
      [&](int frame, const absl::StatusOr<Matte>& matte) -> absl::Status {
        refused.Update(matte.status());
        if (!matte.ok()) return absl::OkStatus();
        solved.note(*matte);
        ++*solved.frames;
        GW_ASSIGN_OR_RETURN(const std::string bytes, encode_matte(*matte));
        if (watched)
          std::cerr << fmt::format("\rsolved {} of {} frames", frame - frames.first + 1, frames.count);
        return write_file_durably(std::filesystem::path(solve.matte) / fmt::format("{:04}.exr", frame),
                                  bytes);
      });
  if (watched) std::cerr << "\n";
  GW_RETURN_IF_ERROR(status);
  print(solve, solved);
  return refused;
}

absl::Status solve(const Solve& solve) {
  MethodOptions options;
  for (const std::string& setting : solve.settings) {
    GW_ASSIGN_OR_RETURN(const auto option, parse_setting(setting));
    options[option.first] = option.second;
  }
  GW_ASSIGN_OR_RETURN(const std::optional<Share> share, share_of(solve.rows));
  GW_ASSIGN_OR_RETURN(const std::unique_ptr<VideoMethod> video, make_video_method(solve.method, options));
  if (video != nullptr) {
    GW_ASSIGN_OR_RETURN(const auto archive, MappedArchive::open(solve.archive));
    return solve_each_frame(*video, *archive, solve, share.value_or(Share()));
  }
  GW_ASSIGN_OR_RETURN(const std::unique_ptr<Method> method, make_method(solve.method, options));
  GW_ASSIGN_OR_RETURN(const auto archive, MappedArchive::open(solve.archive));
  std::optional<RowRange> rows;
  if (share) {
    GW_ASSIGN_OR_RETURN(rows, range_of(*share, archive->manifest().camera().height_px(), "rows"));
  }
  const bool watched = ::isatty(STDERR_FILENO) != 0;
  const auto progress = [&](double part) {
    if (watched) std::cerr << fmt::format("\rsolved {:3.0f} %", 100.0 * part);
  };
  GW_ASSIGN_OR_RETURN(Matte matte,
                      solve_archive(*method, *archive, solve.threads, progress, !solve.as_recorded, rows));
  if (watched) std::cerr << "\n";
  if (rows) {
    mark_part({.archive = archive_digest(archive->manifest()),
               .computes = computes(solve.method),
               .vectors = vector_target(),
               .as_recorded = solve.as_recorded},
              matte.metadata);
  }
  GW_ASSIGN_OR_RETURN(const std::string bytes, encode_matte(matte));
  GW_RETURN_IF_ERROR(write_file_durably(solve.matte, bytes));
  Solved solved;
  solved.note(matte);
  print(solve, solved);
  return absl::OkStatus();
}

}  // namespace

void add_solve_command(CLI::App& app, DaemonOptions& daemon) {
  const auto arguments = std::make_shared<Solve>();
  CLI::App& command = add_command(app, daemon, "solve", "Solve an archive on this machine, without a server",
                                  [arguments]() -> absl::StatusOr<int> {
                                    GW_RETURN_IF_ERROR(solve(*arguments));
                                    return 0;
                                  });
  std::string options;
  for (const SolvingMethod& method : solving_methods()) {
    options += fmt::format("Options of method {}:\n\n", method.name);
    for (const MethodOption& option : method.options)
      options += help_entry(std::string(option.name), description_of(option));
    options += "\n";
  }
  command.footer(options +
                 "Examples:\n"
                 "  glasswing-solver solve archives/vase vase.exr --set modes=2\n"
                 "  glasswing-solver solve archives/vase vase.exr --json\n"
                 "  glasswing-solver solve archives/vase --rows 3/8 -o part-3.exr");
  command.add_option("archive", arguments->archive, "folder with manifest.json")->required();
  command
      .add_option("-o,--output,matte", arguments->matte,
                  "EXR file to write; a directory for a file a frame of a video (method ramp)")
      ->required();
  command
      .add_option(
          "--rows", arguments->rows,
          "solve part K of N equal ranges of rows, such as 3/8; glasswing matte join makes the matte of "
          "all N. Of a video: of its frames, whose mattes lie side by side in the directory")
      ->type_name("K/N");
  command.add_option("--method", arguments->method, "how (docs/methods.md)")->capture_default_str();
  command.add_option("--set", arguments->settings, "NAME=VALUE, an option of the method");
  command.add_flag("--as-recorded", arguments->as_recorded,
                   "leave what the rig did to the frames uncorrected and unsaid (docs/frames.md)");
  command.add_flag("--json", arguments->json, "print a JSON object: warnings, and what is flagged");
  command.add_option("--threads", arguments->threads, "0: one for each core")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
}

}  // namespace glasswing
