#include "server/storage/problems.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include "core/base/status.h"
#include "core/base/time.h"
#include "core/file/set_aside.h"

namespace glasswing {

namespace fs = std::filesystem;

void Problems::set(const std::string& subject, const std::string& text) {
  const std::lock_guard lock(mutex_);
  Problem& known = problems_[subject];
  if (known.text == text) return;
  if (known.since.empty()) known.since = utc_now_rfc3339();
  known.text = text;
  spdlog::error("{}", text);
}

void Problems::clear(const std::string& subject) {
  const std::lock_guard lock(mutex_);
  problems_.erase(subject);
}

std::vector<std::string> Problems::all() const {
  const std::lock_guard lock(mutex_);
  std::vector<std::string> texts;
  for (const auto& [subject, problem] : problems_) texts.push_back(problem.text);
  return texts;
}

std::string Problems::since(const std::string& subject) const {
  const std::lock_guard lock(mutex_);
  const auto known = problems_.find(subject);
  return known == problems_.end() ? "" : known->second.since;
}

absl::Status Problems::set_aside(const fs::path& data, const fs::path& file, const absl::Status& damage,
                                 const std::string& advice) {
  GW_RETURN_IF_ERROR(glasswing::set_aside(data, file));
  set(file.string(), fmt::format("{} was damaged ({}) and was moved to {}; {}", file.string(),
                                 std::string(damage.message()), (data / kDamagedDirectory).string(), advice));
  return absl::OkStatus();
}

absl::Status Problems::set_aside_database(const fs::path& data, const fs::path& file,
                                          const absl::Status& damage, const std::string& advice) {
  for (const char* log : {"-wal", "-shm"}) {
    const fs::path path = file.string() + log;
    if (fs::exists(path)) GW_RETURN_IF_ERROR(glasswing::set_aside(data, path));
  }
  return set_aside(data, file, damage, advice);
}

void Problems::note_set_aside(const fs::path& data) {
  const fs::path aside = data / kDamagedDirectory;
  std::error_code error;
  int count = 0;
  std::string first;
  for (fs::recursive_directory_iterator files(aside, error), end; !error && files != end;
       files.increment(error)) {
    std::error_code unknown;
    if (!files->is_regular_file(unknown)) continue;
    if (++count == 1) first = files->path().lexically_relative(aside).string();
  }
  if (count == 0) return;
  set(aside.string(), fmt::format("{} contains damaged files set aside earlier ({} file{}, such as {}); "
                                  "delete it once nobody needs it",
                                  aside.string(), count, count == 1 ? "" : "s", first));
}

}  // namespace glasswing
