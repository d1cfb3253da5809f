#include "server/storage/matte_files.h"

#include <fmt/format.h>
#include <sys/stat.h>

#include <algorithm>

#include "core/base/checksum.h"
#include "core/base/status.h"
#include "core/file/file.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kDraft = "+draft";

fs::path frame_file(int frame) {
  return fmt::format("{:04d}.exr", frame);
}

// The hexadecimal digits, without the algorithm's name.
std::string_view digits_of(std::string_view checksum) {
  return checksum.substr(std::min(checksum.size(), std::string_view("xxh3:").size()));
}

}  // namespace

std::string tile_name(std::int64_t job, int tile, int attempt, std::string_view checksum) {
  return fmt::format("{}-{}-{}-{}.exr", job, tile, attempt, digits_of(checksum));
}

bool is_named_after(const fs::path& tile, std::string_view bytes) {
  return tile.stem().string().ends_with(fmt::format("-{}", digits_of(checksum_of(bytes))));
}

fs::path MatteFiles::finished(const std::string& session) const {
  return data_ / "mattes" / (session + ".exr");
}

fs::path MatteFiles::finished(const std::string& session, int frame) const {
  return data_ / "mattes" / session / frame_file(frame);
}

fs::path MatteFiles::next(const std::string& session) const {
  return finished(session + "+next");
}

fs::path MatteFiles::next(const std::string& session, int frame) const {
  return finished(session + "+next", frame);
}

fs::path MatteFiles::draft(const std::string& session) const {
  return finished(session + std::string(kDraft));
}

fs::path MatteFiles::composite(const std::string& session) const {
  return finished(session + "+composite");
}

std::map<std::string, fs::path> MatteFiles::drafts() const {
  std::map<std::string, fs::path> drafts;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(data_ / "mattes", error)) {
    const std::string stem = entry.path().stem().string();
    if (entry.path().extension() == ".exr" && stem.ends_with(kDraft))
      drafts[stem.substr(0, stem.size() - kDraft.size())] = entry.path();
  }
  return drafts;
}

absl::StatusOr<fs::path> MatteFiles::tiles(const std::string& session) const {
  fs::path directory = data_ / "tiles" / session;
  GW_RETURN_IF_ERROR(make_directory_durably(directory));
  return directory;
}

absl::Status MatteFiles::make_next(const std::string& session) const {
  return make_directory_durably(next(session, 0).parent_path());
}

absl::Status MatteFiles::drop_next(const std::string& session) const {
  std::error_code ignored;  // leftover tiles are never read
  fs::remove_all(data_ / "tiles" / session, ignored);
  for (const fs::path& path : {next(session), next(session, 0).parent_path()}) {
    std::error_code error;
    fs::remove_all(path, error);
    if (error) return absl::ErrnoToStatus(error.value(), fmt::format("cannot remove {}", path.string()));
  }
  return flush_directory(data_ / "mattes");
}

absl::Status MatteFiles::finish(const std::string& session) const {
  const fs::path file = finished(session), frames = finished(session, 0).parent_path();
  const fs::path next_file = next(session), next_frames = next(session, 0).parent_path();
  const fs::path old_frames = data_ / "mattes" / (session + "+old");
  // Another session's matte may have the name of our frames' directory, and vice versa.
  const bool had_file = fs::is_regular_file(file), had_frames = fs::is_directory(frames);
  std::error_code ignored;
  if (fs::exists(next_file)) {
    fs::remove(composite(session), ignored);  // of the matte that is replaced
    GW_RETURN_IF_ERROR(rename_file(next_file, file));
    GW_RETURN_IF_ERROR(flush_directory(data_ / "mattes"));
    if (had_frames) fs::remove_all(frames, ignored);
  } else if (fs::exists(next_frames)) {
    fs::remove_all(old_frames, ignored);
    if (had_frames) GW_RETURN_IF_ERROR(rename_file(frames, old_frames));
    GW_RETURN_IF_ERROR(rename_file(next_frames, frames));
    GW_RETURN_IF_ERROR(flush_directory(data_ / "mattes"));
    if (had_file) fs::remove(file, ignored);
  }
  fs::remove_all(old_frames, ignored);
  fs::remove(draft(session), ignored);
  fs::remove_all(data_ / "tiles" / session, ignored);
  return absl::OkStatus();
}

std::vector<fs::path> MatteFiles::directories(const std::string& session) const {
  return {finished(session, 0).parent_path(), next(session, 0).parent_path(),
          data_ / "mattes" / (session + "+old"), data_ / "tiles" / session,
          data_ / "tiles" / (session + "+put")};
}

std::vector<fs::path> MatteFiles::files(const std::string& session) const {
  std::vector<fs::path> found = {finished(session), next(session), draft(session), composite(session)};
  std::error_code error;
  for (const fs::path& directory : directories(session)) {
    for (fs::directory_iterator entry(directory, error), end; !error && entry != end; entry.increment(error))
      found.push_back(entry->path());
  }
  std::erase_if(found, [&](const fs::path& path) { return !fs::is_regular_file(path, error); });
  return found;
}

std::int64_t MatteFiles::bytes(const std::string& session) const {
  std::int64_t bytes = 0;
  for (const fs::path& path : files(session)) {
    std::error_code gone;
    const std::uintmax_t size = fs::file_size(path, gone);
    if (!gone) bytes += static_cast<std::int64_t>(size);
  }
  return bytes;
}

absl::Time MatteFiles::finished_at(const std::string& session) const {
  for (const fs::path& path : {finished(session), finished(session, 0).parent_path()}) {
    struct stat entry {};
    if (::stat(path.c_str(), &entry) == 0) return absl::TimeFromTimespec(entry.st_mtim);
  }
  return absl::InfiniteFuture();
}

absl::StatusOr<std::int64_t> MatteFiles::remove(const std::string& session) const {
  std::int64_t bytes = 0;
  std::error_code error, unknown;
  for (const fs::path& path : files(session)) {
    const std::int64_t size = fs::file_size(path, error);
    if (error || !fs::remove(path, error)) break;
    bytes += size;
  }
  for (const fs::path& directory : directories(session)) {
    if (!error && fs::is_directory(directory, unknown)) fs::remove(directory, error);
  }
  if (error) {
    return absl::ErrnoToStatus(error.value(),
                               fmt::format("cannot remove the mattes of session \"{}\"", session));
  }
  GW_RETURN_IF_ERROR(flush_directory(data_ / "mattes"));
  return bytes;
}

}  // namespace glasswing
