#include "server/storage/image_files.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "core/base/name.h"
#include "core/base/status.h"
#include "core/image/photo.h"
#include "server/storage/image_name.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

constexpr char kUploading[] = ".tmp";

}  // namespace

ImageFiles::Upload::Upload(Upload&& other) noexcept
    : files_(std::exchange(other.files_, nullptr)),
      file_(std::move(other.file_)),
      head_(std::move(other.head_)),
      is_checked_(other.is_checked_),
      size_bytes_(other.size_bytes_),
      checksum_(std::move(other.checksum_)) {}

ImageFiles::Upload::~Upload() {
  std::error_code ignored;
  if (files_ != nullptr) fs::remove(file_.path(), ignored);
}

absl::Status ImageFiles::Upload::add(std::string_view bytes) {
  size_bytes_ += static_cast<std::int64_t>(bytes.size());
  if (size_bytes_ > kMaxPhotoBytes) {
    return absl::InvalidArgumentError(fmt::format("the photo is larger than {} MiB", kMaxPhotoBytes >> 20));
  }
  if (!is_checked_) {
    head_.append(bytes.substr(0, kPhotoHeadBytes));
    if (head_.size() >= kPhotoHeadBytes) {
      GW_RETURN_IF_ERROR(photo_size(head_).status());
      is_checked_ = true;
    }
  }
  checksum_.add(bytes);
  return file_.add(bytes);
}

absl::StatusOr<std::string> ImageFiles::Upload::finish() {
  if (!is_checked_) GW_RETURN_IF_ERROR(photo_size(head_).status());
  GW_RETURN_IF_ERROR(file_.flush());
  std::string name = image_name_of(checksum_.text());
  const std::lock_guard lock(files_->mutex_);
  GW_RETURN_IF_ERROR(rename_file(file_.path(), files_->path(name)));
  GW_RETURN_IF_ERROR(flush_directory(files_->directory_));
  files_->await(name);
  files_ = nullptr;
  return name;
}

absl::StatusOr<std::unique_ptr<ImageFiles>> ImageFiles::open(
    const fs::path& directory, const std::optional<std::set<std::string>>& used) {
  GW_RETURN_IF_ERROR(make_directory_durably(directory));
  std::unique_ptr<ImageFiles> files(new ImageFiles(directory));
  std::vector<std::pair<fs::file_time_type, std::string>> awaited;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(directory, error)) {
    std::string name = entry.path().filename().string();
    if (entry.path().extension() == kUploading) {
      fs::remove(entry.path(), error);
    } else if (!used || used->contains(name)) {
      files->used_.insert(std::move(name));
    } else {
      awaited.emplace_back(entry.last_write_time(error), std::move(name));
    }
  }
  std::ranges::sort(awaited);
  const std::lock_guard lock(files->mutex_);
  for (const auto& [time, name] : awaited) files->await(name);
  return files;
}

absl::StatusOr<ImageFiles::Upload> ImageFiles::begin() {
  GW_ASSIGN_OR_RETURN(FileWriter file, FileWriter::create(directory_ / (random_token() + kUploading)));
  return Upload(*this, std::move(file));
}

bool ImageFiles::has(const std::string& name) const {
  return check_name("image", name).ok() && fs::exists(directory_ / name);
}

void ImageFiles::use(const std::set<std::string>& names) {
  const std::lock_guard lock(mutex_);
  used_.insert(names.begin(), names.end());
  std::erase_if(awaited_, [&](const Awaited& each) {
    if (!names.contains(each.name)) return false;
    awaited_bytes_ -= each.size_bytes;
    return true;
  });
}

void ImageFiles::used_also_by(std::function<std::set<std::string>()> others) {
  const std::lock_guard lock(mutex_);
  others_ = std::move(others);
}

void ImageFiles::release(const std::set<std::string>& names,
                         const std::optional<std::set<std::string>>& used) {
  if (!used) return;
  const std::lock_guard lock(mutex_);
  used_ = *used;
  if (others_) used_.merge(others_());
  for (const std::string& name : names) {
    const bool is_awaited = std::ranges::count(awaited_, name, &Awaited::name) > 0;
    if (!used_.contains(name) && !is_awaited && has(name)) remove(name);
  }
}

void ImageFiles::await(const std::string& name) {
  if (const auto known = std::ranges::find(awaited_, name, &Awaited::name); known != awaited_.end()) {
    awaited_.splice(awaited_.end(), awaited_, known);
    return;
  }
  std::error_code error;
  const std::int64_t size = fs::file_size(directory_ / name, error);
  awaited_.push_back({.name = name, .size_bytes = error ? 0 : size});
  awaited_bytes_ += awaited_.back().size_bytes;
  while (awaited_.size() > kMaxAwaited || (awaited_bytes_ > kMaxAwaitedBytes && awaited_.size() > 1)) {
    awaited_bytes_ -= awaited_.front().size_bytes;
    if (!used_.contains(awaited_.front().name)) remove(awaited_.front().name);
    awaited_.pop_front();
  }
}

// Not flushed: one that reappears after a power cut is expected again.
void ImageFiles::remove(const std::string& name) const {
  std::error_code ignored;
  fs::remove(directory_ / name, ignored);
}

}  // namespace glasswing
