#include "core/archive/check_archive.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <optional>
#include <set>
#include <sstream>
#include <utility>

#include "core/base/checksum.h"
#include "core/base/name.h"
#include "core/base/status.h"
#include "core/file/file.h"
#include "core/frame/archive.h"
#include "core/frame/archive_json.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;
using Frames = std::vector<v1::Frame>;

std::string lines_of(const Frames& frames) {
  std::string lines;
  for (const v1::Frame& frame : frames) lines += archive_json(frame, false) + "\n";
  return lines;
}

class ArchiveCheck {
 public:
  ArchiveCheck(fs::path directory, Check& check) : directory_(std::move(directory)), check_(check) {}

  void run() {
    read_manifest();
    read_header();
    if (!header_) return;  // there is no list of what the frames should be
    read_journal();
    settle_lists();
    for (const v1::Frame& frame : Frames(frames_)) check_frame_file(frame);
    check_orphans();
    check_leftovers(directory_, check_);
  }

 private:
  fs::path path(const char* name) const { return directory_ / name; }
  bool has(const char* name) const { return fs::exists(path(name)); }
  bool is_exported() const { return has("manifest.json") && !has("header.json") && !has("frames.jsonl"); }

  absl::Status replace(const char* name, const std::string& bytes) {
    GW_RETURN_IF_ERROR(copy_aside(directory_, path(name)));
    return write_file_durably(path(name), bytes);
  }
  absl::Status write_manifest() {
    v1::CaptureManifest manifest = *header_;
    for (const v1::Frame& frame : frames_) *manifest.add_frames() = frame;
    return replace("manifest.json", archive_json(manifest, true));
  }

  void read_manifest() {
    is_sealed_ = has("manifest.json");
    if (!is_sealed_) return;
    const absl::StatusOr<std::string> json = check_.read(path("manifest.json"));
    v1::CaptureManifest manifest;
    manifest_error_ = json.ok() ? parse_archive_json(*json, path("manifest.json"), &manifest) : json.status();
    manifest_error_.Update(check_manifest(manifest));
    if (manifest_error_.ok()) manifest_ = std::move(manifest);
  }

  void read_header() {
    absl::Status error;
    if (!is_exported()) {
      const absl::StatusOr<std::string> json = check_.read(path("header.json"));
      v1::CaptureManifest header;
      error = json.ok() ? parse_archive_json(*json, path("header.json"), &header) : json.status();
      error.Update(check_manifest_header(header));
      if (error.ok()) header_ = std::move(header);
    } else if (!manifest_) {
      check_.found({.file = path("manifest.json").string(),
                    .what = std::string(manifest_error_.message()),
                    .meaning = "no other file records what the frames show: restore it from a copy or a "
                               "backup",
                    .repair = ""});
      return;
    }
    if (header_) header_->clear_frames();
    if (header_) return;
    if (manifest_) {
      header_ = *manifest_;
      header_->clear_frames();
    }
    if (is_exported()) return;
    check_.found(
        {.file = path("header.json").string(),
         .what = std::string(error.message()),
         .meaning = manifest_ ? "the archive cannot be opened; manifest.json has the same content"
                              : "no other file records what the frames show; a copy on another node, "
                                "or a backup, does",
         .repair = manifest_ ? "it is rebuilt from manifest.json" : ""},
        [&] { return replace("header.json", archive_json(*header_, true)); });
  }

  void read_journal() {
    if (is_exported() || !has("frames.jsonl")) return;
    absl::StatusOr<std::string> lines = check_.read(path("frames.jsonl"));
    if (!lines.ok()) {
      unreadable_lines_ = 1;
      return;
    }
    const size_t end = lines->rfind('\n');
    is_torn_ = !lines->empty() && end != lines->size() - 1;
    const size_t ended = end == std::string::npos ? 0 : end + 1;
    const size_t record =
        whole_record(std::string_view(*lines).substr(ended));  // a record that only lacks its newline
    lines->resize(ended + record);
    if (record > 0) *lines += '\n';
    journal_ = *lines;
    std::istringstream each(*lines);
    for (std::string line; std::getline(each, line);) {
      v1::Frame frame;
      const bool good =
          parse_archive_json(line, path("frames.jsonl"), &frame).ok() && check_frame(frame).ok();
      if (good) frames_.push_back(std::move(frame));
      if (!good) ++unreadable_lines_;
    }
  }

  // Merges both lists: the journal's record of a frame counts, and the manifest adds what the journal lacks.
  void settle_lists() {
    std::map<std::string, v1::Frame> in_journal;
    for (const v1::Frame& frame : frames_) in_journal.emplace(frame.file(), frame);
    Frames both = std::exchange(frames_, {});
    if (manifest_) both.insert(both.begin(), manifest_->frames().begin(), manifest_->frames().end());
    std::set<std::string> listed;
    for (const v1::Frame& frame : both) {
      if (!listed.insert(frame.file()).second) continue;
      const auto journalled = in_journal.find(frame.file());
      frames_.push_back(journalled == in_journal.end() ? frame : journalled->second);
    }
    if (is_exported()) return;
    if (unreadable_lines_ > 0 || journal_ != lines_of(frames_)) found_bad_journal();
    if (is_torn_ && unreadable_lines_ == 0) {
      check_.found({.file = path("frames.jsonl").string(),
                    .what = "its last line is truncated",
                    .meaning = "this frame was never acknowledged as stored",
                    .repair = "the line is dropped",
                    .is_damage = false},
                   [&] { return replace("frames.jsonl", lines_of(frames_)); });
    }
    if (!is_sealed_) return;
    const bool same = manifest_ && lines_of(Frames(manifest_->frames().begin(), manifest_->frames().end())) ==
                                       lines_of(frames_);
    if (same) return;
    check_.found(
        {.file = path("manifest.json").string(),
         .what = manifest_ ? "it does not list the frames that frames.jsonl lists"
                           : std::string(manifest_error_.message()),
         .meaning = "programs that read the directory directly would miss frames; the camera node does not",
         .repair = "it is rebuilt from header.json and frames.jsonl"},
        [&] { return write_manifest(); });
  }

  void found_bad_journal() {
    // With as many lines as frames, the lines are the same records in another format.
    if (unreadable_lines_ == 0 && is_same_list()) return;
    check_.found(
        {.file = path("frames.jsonl").string(),
         .what = unreadable_lines_ > 0 ? fmt::format("{} of its lines cannot be read", unreadable_lines_)
                                       : "it lacks frames that manifest.json lists, or lists some twice",
         .meaning = manifest_ ? "the archive cannot be opened, or misses frames; manifest.json has them all"
                              : "the archive cannot be opened; frames of these lines count as not captured",
         .repair = manifest_ ? "it is rebuilt from manifest.json"
                             : "these lines are dropped, and glasswing resume or retry recaptures their "
                               "frames"},
        [&] { return replace("frames.jsonl", lines_of(frames_)); });
  }

  bool is_same_list() const {
    return static_cast<size_t>(std::count(journal_.begin(), journal_.end(), '\n')) == frames_.size();
  }

  absl::Status verify(const v1::Frame& frame) {
    GW_ASSIGN_OR_RETURN(const std::string bytes, check_.read(directory_ / frame.file()));
    if (frame.checksum().empty()) return absl::OkStatus();
    if (const std::string checksum = checksum_of(bytes); checksum != frame.checksum())
      return absl::DataLossError(fmt::format("its checksum is {} instead of {}", checksum, frame.checksum()));
    return check_tiff_head(bytes, bytes.size(), shape_of(header_->camera()));
  }

  void check_frame_file(const v1::Frame& frame) {
    const fs::path file = directory_ / frame.file();
    const absl::Status status = verify(frame);
    if (status.ok()) return;
    const bool is_there = fs::exists(file);
    Finding finding{
        .file = file.string(), .what = std::string(status.message()), .meaning = "", .repair = ""};
    if (is_sealed_) {
      finding.meaning = fmt::format(
          "solves of session \"{}\" read it from a copy on another node, if there is one, and fail "
          "otherwise; glasswing replicate repairs a damaged copy",
          header_->session());
      if (is_there) finding.repair = "it is set aside; its entry in the list stays, for a copy of it";
    } else {
      finding.meaning = "the session is still being captured, and this frame can be recaptured";
      finding.repair = "it is set aside and removed from the list: glasswing resume or retry recaptures it";
    }
    check_.found(std::move(finding), [&]() -> absl::Status {
      if (!is_sealed_) {
        std::erase_if(frames_, [&](const v1::Frame& other) { return other.file() == frame.file(); });
        GW_RETURN_IF_ERROR(write_file_durably(path("frames.jsonl"), lines_of(frames_)));
      }
      return is_there ? set_aside(directory_, file) : absl::OkStatus();
    });
  }

  void check_orphans() {
    std::set<fs::path> listed;
    for (const v1::Frame& frame : frames_) listed.insert((directory_ / frame.file()).lexically_normal());
    std::error_code error;
    std::vector<fs::path> files;
    for (const fs::directory_entry& entry : fs::directory_iterator(directory_ / "frames", error))
      if (entry.is_regular_file() && entry.path().extension() != ".tmp") files.push_back(entry.path());
    for (const fs::path& file : files) {
      if (listed.contains(file.lexically_normal())) continue;
      check_.found({.file = file.string(),
                    .what = "it is in no list of frames",
                    .meaning = "it was never acknowledged as stored: no frame of the session refers to it",
                    .repair = "it is set aside",
                    .is_damage = false},
                   [&] { return fs::exists(file) ? set_aside(directory_, file) : absl::OkStatus(); });
    }
  }

  const fs::path directory_;
  Check& check_;
  bool is_sealed_ = false, is_torn_ = false;
  std::optional<v1::CaptureManifest> manifest_, header_;
  absl::Status manifest_error_;
  std::string journal_;
  int unreadable_lines_ = 0;
  Frames frames_;
};

// An interrupted removal, or an archive that was never begun.
void check_half(const fs::path& directory, Check& check) {
  const bool removed = directory.filename().string().starts_with(".removed-");
  check.found({.file = directory.string(),
               .what = removed ? "its removal was interrupted" : "it contains no archive",
               .meaning = removed ? "the session was deleted; this only takes up space"
                                  : "an archive was to be created here, but was not",
               .repair = removed ? "it is removed, as requested" : "it is set aside",
               .is_damage = false},
              [&]() -> absl::Status {
                if (!removed) return set_aside(directory.parent_path(), directory);
                std::error_code error;
                fs::remove_all(directory, error);
                if (!error) return absl::OkStatus();
                return absl::ErrnoToStatus(error.value(), "cannot remove " + directory.string());
              });
}

}  // namespace

bool is_archive(const fs::path& directory) {
  return std::ranges::any_of(
      std::initializer_list<const char*>{"header.json", "manifest.json", "frames.jsonl"},
      [&](const char* name) { return fs::exists(directory / name); });
}

void check_archive(const fs::path& directory, Check& check) {
  ArchiveCheck(directory, check).run();
}

void check_archives(const fs::path& directory, Check& check) {
  std::set<fs::path> below;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(directory, error))
    if (entry.is_directory() && entry.path().filename() != kDamagedDirectory) below.insert(entry.path());
  for (const fs::path& each : below) {
    if (is_archive(each) && check_name("session", each.filename().string()).ok()) {
      check_archive(each, check);
    } else {
      check_half(each, check);
    }
  }
}

}  // namespace glasswing
