#include "core/frame/archive.h"

#include <fmt/format.h>
#include <google/protobuf/util/message_differencer.h>

#include <algorithm>
#include <sstream>

#include "core/base/checksum.h"
#include "core/base/status.h"
#include "core/file/fault_point.h"
#include "core/file/file.h"
#include "core/frame/archive_json.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

// Linux allows a process about 65,000.
constexpr size_t kMaxMappings = 4096;

absl::Status read_json(const fs::path& path, google::protobuf::Message* message) {
  GW_ASSIGN_OR_RETURN(const std::string json, read_file(path));
  return parse_archive_json(json, path, message);
}

absl::Status data_loss_in(const fs::path& path, const absl::Status& status) {
  if (status.ok()) return status;
  return absl::DataLossError(fmt::format("{}: {}", path.string(), std::string(status.message())));
}

// Frames without a step (imported ones) are identified by their file.
bool same_frame(const v1::Frame& a, const v1::Frame& b) {
  return a.step() >= 0 && b.step() >= 0 ? a.step() == b.step() : a.file() == b.file();
}

absl::Status check_new_frame(const v1::Frame& frame) {
  GW_RETURN_IF_ERROR(check_frame(frame));
  if (is_stored_name(frame.file())) return absl::OkStatus();
  return absl::InvalidArgumentError(
      fmt::format("a new frame's file is \"{}\"; it must be frames/NAME, and NAME must not start with a dot",
                  frame.file()));
}

bool is_sealed(const fs::path& directory) {
  std::error_code error;
  return fs::exists(directory / "manifest.json", error);
}

}  // namespace

bool is_stored_name(const std::string& file) {
  const std::string name = fs::path(file).filename();
  return !name.empty() && name.front() != '.' && file == "frames/" + name;
}

bool is_stored_frame(const v1::Frame& frame) {
  return is_stored_name(frame.file()) && frame.file().ends_with(".tif");
}

Archive::Archive(fs::path directory, v1::CaptureManifest manifest)
    : directory_(std::move(directory)),
      shape_(shape_of(manifest.camera())),
      manifest_(std::move(manifest)),
      sealed_(is_sealed(directory_)) {
  for (int i = 0; i < manifest_.frames_size(); ++i) note_place(i);
}

void Archive::note_place(int index) {
  const v1::Frame& frame = manifest_.frames(index);
  index_of_file_[frame.file()] = index;
  if (frame.step() >= 0) index_of_step_.try_emplace(frame.step(), index);
}

const v1::Frame* Archive::stored_as(const v1::Frame& record) const {
  if (const auto step = index_of_step_.find(record.step()); step != index_of_step_.end())
    return &manifest_.frames(step->second);
  const auto file = index_of_file_.find(record.file());
  if (file == index_of_file_.end()) return nullptr;
  const v1::Frame& known = manifest_.frames(file->second);
  return same_frame(known, record) ? &known : nullptr;
}

absl::StatusOr<std::unique_ptr<Archive>> Archive::create(const fs::path& directory,
                                                         const v1::CaptureManifest& header) {
  if (fs::exists(directory / "header.json")) {
    GW_ASSIGN_OR_RETURN(std::unique_ptr<Archive> archive, open(directory));
    if (archive->manifest().session() != header.session()) {
      return absl::FailedPreconditionError(fmt::format("{} holds session \"{}\", not \"{}\"",
                                                       directory.string(), archive->manifest().session(),
                                                       header.session()));
    }
    return archive;
  }
  GW_RETURN_IF_ERROR(check_manifest_header(header));
  GW_RETURN_IF_ERROR(make_directory_durably(directory / "frames"));
  v1::CaptureManifest without_frames = header;
  without_frames.clear_frames();
  without_frames.set_format_version(1);
  GW_RETURN_IF_ERROR(write_file_durably(directory / "header.json", archive_json(without_frames, true)));
  fault_point("archive begun");
  GW_RETURN_IF_ERROR(flush_directory(directory.parent_path().empty() ? "." : directory.parent_path()));
  return std::unique_ptr<Archive>(new Archive(directory, std::move(without_frames)));
}

absl::StatusOr<std::unique_ptr<Archive>> Archive::open(const fs::path& directory) {
  v1::CaptureManifest manifest;
  const fs::path header = directory / "header.json";
  GW_RETURN_IF_ERROR(read_json(header, &manifest));
  manifest.clear_frames();
  if (manifest.format_version() != 1) {
    return absl::DataLossError(fmt::format("{}: format_version is {}; this program reads 1", header.string(),
                                           manifest.format_version()));
  }
  GW_RETURN_IF_ERROR(data_loss_in(header, check_manifest_header(manifest)));
  const fs::path journal = directory / "frames.jsonl";
  absl::StatusOr<std::string> lines = read_file(journal);
  if (absl::IsNotFound(lines.status())) lines = "";
  GW_RETURN_IF_ERROR(lines.status());
  const size_t whole = lines->rfind('\n') == std::string::npos ? 0 : lines->rfind('\n') + 1;
  if (whole != lines->size()) {
    // A line cut by a crash was never reported as stored, and later lines must not be appended to it. A
    // complete record may lack only its newline.
    const size_t record = whole_record(std::string_view(*lines).substr(whole));
    lines->resize(whole + record);
    if (record > 0) *lines += '\n';
    GW_RETURN_IF_ERROR(write_file_durably(journal, *lines));
  }
  std::istringstream each(*lines);
  for (std::string line; std::getline(each, line);) {
    v1::Frame& frame = *manifest.add_frames();
    GW_RETURN_IF_ERROR(parse_archive_json(line, journal, &frame));
    GW_RETURN_IF_ERROR(data_loss_in(journal, check_frame(frame)));
  }
  return std::unique_ptr<Archive>(new Archive(directory, std::move(manifest)));
}

v1::CaptureManifest Archive::manifest() const {
  const std::lock_guard lock(mutex_);
  return manifest_;
}

absl::StatusOr<std::vector<v1::Frame>> Archive::add(const std::vector<NewFrame>& frames, FrameForm form) {
  const std::lock_guard lock(mutex_);
  std::vector<v1::Frame> stored;
  std::vector<v1::Frame> fresh;
  for (const NewFrame& frame : frames) {
    v1::Frame record = frame.record;
    if (record.file().empty()) record.set_file(fmt::format("frames/{:06d}.tif", record.step()));
    const auto is_same = [&](const v1::Frame& other) { return same_frame(other, record); };
    const auto has_file = [&](const v1::Frame& other) { return other.file() == record.file(); };
    if (const v1::Frame* known = stored_as(record)) {
      stored.push_back(*known);
      continue;
    }
    if (const auto known = std::ranges::find_if(fresh, is_same); known != fresh.end()) {
      stored.push_back(*known);
      continue;
    }
    GW_RETURN_IF_ERROR(check_open());
    GW_RETURN_IF_ERROR(check_new_frame(record));
    if (index_of_file_.contains(record.file()) || std::ranges::any_of(fresh, has_file))
      return absl::AlreadyExistsError(fmt::format("{} holds another {}", directory_.string(), record.file()));
    GW_RETURN_IF_ERROR(check_shape(record.file(), shape_of(frame.image), shape_));
    const std::string bytes = encode_tiff(frame.image, form);
    record.set_checksum(checksum_of(bytes));
    record.set_size_bytes(static_cast<std::int64_t>(bytes.size()));
    GW_RETURN_IF_ERROR(write_file_flushed(directory_ / record.file(), bytes));
    fresh.push_back(record);
    stored.push_back(std::move(record));
  }
  if (fresh.empty()) return stored;
  GW_RETURN_IF_ERROR(enter(fresh));
  return stored;
}

absl::StatusOr<bool> Archive::is_new_locked(const v1::Frame& record) const {
  GW_RETURN_IF_ERROR(check_new_frame(record));
  const auto file = index_of_file_.find(record.file());
  // Resuming an interrupted import with different frames must not mix the two sets.
  if (file != index_of_file_.end() && manifest_.frames(file->second).checksum() != record.checksum()) {
    return absl::AlreadyExistsError(
        fmt::format("session \"{}\" already has a different {}; import under another name",
                    manifest_.session(), record.file()));
  }
  if (const v1::Frame* const known = stored_as(record)) {
    if (known->file() == record.file() && known->checksum() == record.checksum()) return false;
    return absl::AlreadyExistsError(
        fmt::format("session \"{}\" already has {} of step {}, not this {}; import under another name",
                    manifest_.session(), known->file(), known->step(), record.file()));
  }
  GW_RETURN_IF_ERROR(check_open());
  if (file == index_of_file_.end()) return true;
  return absl::AlreadyExistsError(fmt::format("{} holds another {}", directory_.string(), record.file()));
}

absl::StatusOr<bool> Archive::is_new(const v1::Frame& record) const {
  const std::lock_guard lock(mutex_);
  return is_new_locked(record);
}

absl::Status Archive::add_arrived(const std::vector<ArrivedFrame>& frames) {
  const std::lock_guard lock(mutex_);
  std::vector<v1::Frame> fresh;
  std::vector<const ArrivedFrame*> moved;
  for (const ArrivedFrame& frame : frames) {
    GW_ASSIGN_OR_RETURN(const bool is_new, is_new_locked(frame.record));
    if (!is_new) continue;
    const auto known = std::ranges::find_if(fresh, [&](const v1::Frame& other) {
      return same_frame(other, frame.record) || other.file() == frame.record.file();
    });
    if (known == fresh.end()) {
      fresh.push_back(frame.record);
      moved.push_back(&frame);
    } else if (known->checksum() != frame.record.checksum() || known->file() != frame.record.file()) {
      return absl::AlreadyExistsError(
          fmt::format("the call has {} and another frame of its step or file", frame.record.file()));
    }
  }
  for (const ArrivedFrame* frame : moved)
    GW_RETURN_IF_ERROR(rename_file(frame->file, directory_ / frame->record.file()));
  return fresh.empty() ? absl::OkStatus() : enter(fresh);
}

absl::Status Archive::check_open() const {
  if (!sealed_) return absl::OkStatus();
  return absl::FailedPreconditionError(
      fmt::format("{} is sealed: it accepts no new frames", directory_.string()));
}

absl::Status Archive::enter(const std::vector<v1::Frame>& fresh) {
  std::string journal_lines;
  for (const v1::Frame& record : fresh) journal_lines += archive_json(record, false) + "\n";
  GW_RETURN_IF_ERROR(flush_directory(directory_ / "frames"));
  fault_point("frames written");
  GW_RETURN_IF_ERROR(append_file_durably(directory_ / "frames.jsonl", journal_lines));
  fault_point("frames listed");
  for (const v1::Frame& record : fresh) {
    *manifest_.add_frames() = record;
    note_place(manifest_.frames_size() - 1);
  }
  return absl::OkStatus();
}

absl::Status Archive::add_copies(const std::vector<CopiedFrame>& frames) {
  for (const auto& [record, bytes] : frames) {
    GW_RETURN_IF_ERROR(check_new_frame(record));
    if (checksum_of(bytes) != record.checksum() || !check_tiff_head(bytes, bytes.size(), shape_).ok()) {
      return absl::InvalidArgumentError(fmt::format("{} has checksum {}; {} was announced", record.file(),
                                                    checksum_of(bytes), record.checksum()));
    }
    const absl::StatusOr<v1::Frame> known = find(record.file());
    if (known.ok() && known->checksum() != record.checksum()) {
      return absl::AlreadyExistsError(fmt::format("{} holds another {}", directory_.string(), record.file()));
    }
    GW_RETURN_IF_ERROR(write_file_flushed(directory_ / record.file(), bytes));
  }
  GW_RETURN_IF_ERROR(flush_directory(directory_ / "frames"));
  const std::lock_guard lock(mutex_);
  std::vector<v1::Frame> fresh;
  for (const CopiedFrame& frame : frames)
    if (!index_of_file_.contains(frame.record.file())) fresh.push_back(frame.record);
  return fresh.empty() ? absl::OkStatus() : enter(fresh);
}

absl::Status Archive::drop(const std::function<bool(int)>& is_dropped) {
  const std::lock_guard lock(mutex_);
  if (sealed_) {
    std::error_code error;
    fs::remove(directory_ / "manifest.json", error);
    if (error)
      return absl::UnavailableError(
          fmt::format("{}: {}", (directory_ / "manifest.json").string(), error.message()));
    GW_RETURN_IF_ERROR(flush_directory(directory_));
    sealed_ = false;
  }
  std::string journal;
  std::vector<v1::Frame> kept, dropped;
  for (const v1::Frame& frame : manifest_.frames()) {
    const bool drops = frame.step() >= 0 && is_dropped(frame.step());
    (drops ? dropped : kept).push_back(frame);
    if (!drops) journal += archive_json(frame, false) + "\n";
  }
  if (dropped.empty()) return absl::OkStatus();
  GW_RETURN_IF_ERROR(write_file_durably(directory_ / "frames.jsonl", journal));
  manifest_.mutable_frames()->Assign(kept.begin(), kept.end());
  index_of_file_.clear();
  index_of_step_.clear();
  for (int i = 0; i < manifest_.frames_size(); ++i) note_place(i);
  for (const v1::Frame& frame : dropped) {
    verified_.erase(frame.file());
    mapped_.erase(frame.file());
    // No longer listed: a remaining file is overwritten by the step's next frame.
    std::error_code ignored;
    fs::remove(directory_ / frame.file(), ignored);
  }
  return absl::OkStatus();
}

absl::Status Archive::seal(const v1::Plan* plan) {
  const std::lock_guard lock(mutex_);
  if (plan != nullptr) {
    v1::Plan before = manifest_.plan(), after = *plan;
    for (v1::Plan* each : {&before, &after}) {
      each->clear_rounds();
      each->clear_retries();  // a resumed session may have more
    }
    if (!google::protobuf::util::MessageDifferencer::Equals(before, after)) {
      return absl::InvalidArgumentError(fmt::format(
          "the plan is not that of session \"{}\"; only its rounds may differ", manifest_.session()));
    }
    v1::CaptureManifest header = manifest_;
    header.clear_frames();
    *header.mutable_plan() = *plan;
    GW_RETURN_IF_ERROR(check_manifest_header(header));
    // First, since opening an archive reads its header from there.
    GW_RETURN_IF_ERROR(write_file_durably(directory_ / "header.json", archive_json(header, true)));
    *manifest_.mutable_plan() = *plan;
  }
  GW_RETURN_IF_ERROR(write_file_durably(directory_ / "manifest.json", archive_json(manifest_, true)));
  sealed_ = true;
  fault_point("archive sealed");
  return absl::OkStatus();
}

absl::StatusOr<v1::Frame> Archive::frame_of_step(int step) const {
  const std::lock_guard lock(mutex_);
  if (const auto found = index_of_step_.find(step); found != index_of_step_.end())
    return manifest_.frames(found->second);
  return absl::NotFoundError(
      fmt::format("session \"{}\" has no frame of step {}", manifest_.session(), step));
}

absl::StatusOr<v1::Frame> Archive::find(const std::string& file) const {
  const std::lock_guard lock(mutex_);
  const auto found = index_of_file_.find(file);
  if (found == index_of_file_.end()) {
    return absl::NotFoundError(fmt::format("session \"{}\" has no frame \"{}\"", manifest_.session(), file));
  }
  return manifest_.frames(found->second);
}

absl::Status Archive::verify(const MappedFile& mapped, const v1::Frame& frame) const {
  const std::string checksum = checksum_of(mapped.bytes());
  const absl::Status head = check_tiff_head(mapped.bytes(), mapped.bytes().size(), shape_);
  if (!mapped.intact()) return absl::DataLossError("it cannot be read to its end");
  if (checksum != frame.checksum()) {
    return absl::DataLossError(fmt::format("its checksum is {} instead of {}", checksum, frame.checksum()));
  }
  return head;
}

absl::StatusOr<std::shared_ptr<const MappedFile>> Archive::map(const std::string& file) {
  GW_ASSIGN_OR_RETURN(const v1::Frame frame, find(file));
  const fs::path path = directory_ / file;
  const absl::StatusOr<FileIdentity> identity = identity_of(path);
  FileIdentity verified;
  {
    const std::lock_guard lock(mutex_);
    const auto mapped = mapped_.find(file);
    if (mapped != mapped_.end()) {
      if (identity.ok() && mapped->second->identity() == *identity && mapped->second->intact())
        return mapped->second;
      mapped_.erase(mapped);
    }
    const auto known = verified_.find(file);
    if (known != verified_.end()) verified = known->second;
  }
  GW_ASSIGN_OR_RETURN(const size_t size_bytes, listed_bytes(frame, shape_, path.string()));
  const absl::StatusOr<std::shared_ptr<const MappedFile>> mapped = MappedFile::open(path, size_bytes);
  if (absl::IsOutOfRange(mapped.status()) && identity.ok()) {
    return absl::DataLossError(fmt::format("{} is damaged: it has {} bytes instead of {}", path.string(),
                                           identity->size_bytes, size_bytes));
  }
  if (absl::IsResourceExhausted(mapped.status()))
    return mapped;  // this process has too many files or mappings
  if (!mapped.ok()) return absl::DataLossError(mapped.status().message());
  if ((*mapped)->identity() != verified) {
    const absl::Status whole = verify(**mapped, frame);
    if (!whole.ok()) {
      return absl::DataLossError(
          fmt::format("{} is damaged: {}", path.string(), std::string(whole.message())));
    }
  }
  const std::lock_guard lock(mutex_);
  if (mapped_.size() >= kMaxMappings) mapped_.erase(mapped_.begin());
  verified_[file] = (*mapped)->identity();
  mapped_[file] = *mapped;
  return mapped;
}

void Archive::unmap() {
  const std::lock_guard lock(mutex_);
  mapped_.clear();
}

absl::StatusOr<std::string> Archive::read_frame_bytes(const std::string& file) {
  GW_ASSIGN_OR_RETURN(const std::shared_ptr<const MappedFile> mapped, map(file));
  std::string bytes(mapped->bytes());
  if (!mapped->intact())
    return absl::DataLossError(fmt::format("{} is truncated", (directory_ / file).string()));
  return bytes;
}

absl::Status Archive::check_rows(int first_row, int row_count) const {
  if (first_row >= 0 && row_count >= 1 && first_row <= shape_.height_px - row_count) return absl::OkStatus();
  return absl::InvalidArgumentError(fmt::format("{} rows from row {} requested; the frame has rows 0 to {}",
                                                row_count, first_row, shape_.height_px - 1));
}

}  // namespace glasswing
