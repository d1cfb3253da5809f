// The photos of plans, and the backgrounds of composites, below DATA/images, each named after its content. A
// photo belongs to the sessions whose plans show it and to the items of the queue that name it, and is
// removed with the last of them. Uploads not used yet are kept while they are among the newest.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <filesystem>
#include <functional>
#include <list>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <string_view>

#include "core/base/checksum.h"
#include "core/file/file.h"

namespace glasswing {

// Thread-safe.
class ImageFiles {
 public:
  static constexpr size_t kMaxAwaited = 256;  // photos
  static constexpr std::int64_t kMaxAwaitedBytes = std::int64_t{4} << 30;

  // A photo that arrives in pieces. Nothing of it is kept unless it is finished.
  class Upload {
   public:
    Upload(Upload&& other) noexcept;
    Upload& operator=(Upload&&) = delete;
    ~Upload();
    // INVALID_ARGUMENT: not a PNG that a monitor can show (photo_size()), or more than kMaxPhotoBytes.
    // RESOURCE_EXHAUSTED: the disk is full.
    absl::Status add(std::string_view bytes);
    // Durable when it returns its name.
    absl::StatusOr<std::string> finish();

   private:
    friend class ImageFiles;
    Upload(ImageFiles& files, FileWriter file) : files_(&files), file_(std::move(file)) {}

    ImageFiles* files_;
    FileWriter file_;
    std::string head_;  // first bytes, until they are checked
    bool is_checked_ = false;
    std::int64_t size_bytes_ = 0;
    RunningChecksum checksum_;
  };

  // `used`: the photos that sessions show; absent: unknown, and all files count as used.
  static absl::StatusOr<std::unique_ptr<ImageFiles>> open(const std::filesystem::path& directory,
                                                          const std::optional<std::set<std::string>>& used);

  absl::StatusOr<Upload> begin();
  bool has(const std::string& name) const;  // also false for an invalid name
  std::filesystem::path path(const std::string& name) const { return directory_ / name; }
  // A session, or an item of the queue, uses them from now on.
  void use(const std::set<std::string>& names);
  // `others`: tells which ones more than sessions use, whenever some are released. It may not call this
  // class.
  void used_also_by(std::function<std::set<std::string>()> others);
  // A session that used them is gone. Removes those that are not `used` by others (absent: unknown) and were
  // not uploaded again.
  void release(const std::set<std::string>& names, const std::optional<std::set<std::string>>& used);

 private:
  struct Awaited {
    std::string name;
    std::int64_t size_bytes = 0;
  };
  explicit ImageFiles(std::filesystem::path directory) : directory_(std::move(directory)) {}
  void await(const std::string& name);  // call with mutex_ held
  void remove(const std::string& name) const;

  const std::filesystem::path directory_;
  std::mutex mutex_;
  std::set<std::string> used_;  // guarded by mutex_, as the next
  std::function<std::set<std::string>()> others_;
  // Uploads for future sessions, oldest first; guarded by mutex_.
  std::list<Awaited> awaited_;
  std::int64_t awaited_bytes_ = 0;  // guarded by mutex_
};

}  // namespace glasswing
