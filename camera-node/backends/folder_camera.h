// A camera whose pictures another program drops into a folder: a DSLR through gphoto2, or anything tethered.
// It takes a picture on request, through a command, or by a person who presses the button.
//
// All that is known about an exposure is that it began after the picture was requested and ended before the
// file arrived, if the file is the requested one: it may arrive late, twice, or not at all. So frames are
// untimed (FrameTaken), and their id patch proves them.
#pragma once

#include <absl/status/statusor.h>

#include <deque>
#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "camera-node/backends/folder_watch.h"
#include "camera-node/camera.h"
#include "core/import/photograph_response.h"

namespace glasswing {

class FolderCamera final : public Camera {
 public:
  struct Options {
    std::string name;
    std::filesystem::path directory;
    // Takes one picture; its words are separated by spaces. "gphoto2" stands for a command that uses it.
    // Empty: a person does.
    std::string shoot = {};
    nanoseconds patience = std::chrono::seconds(40);  // from asking to the file
    std::optional<double> exposure_ms = {};           // where files do not tell it
    std::string curve =
        {};  // PhotographResponse of files that are not raw, or "unknown"; empty: by their bits
  };
  // Takes the camera's size from a picture: the first one that the command takes, or else the newest in the
  // folder. INVALID_ARGUMENT: an option is wrong. FAILED_PRECONDITION: there is no such picture; the message
  // says why.
  static absl::StatusOr<std::unique_ptr<FolderCamera>> open(const Options& options);
  ~FolderCamera() override;

  v1::GetCameraResponse describe() const override;
  absl::Status start(double exposure_ms) override;
  std::optional<CapturedFrame> next(std::chrono::milliseconds timeout) override;
  void stop() override;
  absl::Status take_picture(const std::string& what) override;

 private:
  struct Picture {
    std::shared_ptr<const Image16> image;
    v1::Camera camera;  // without its name
    double exposure_ms = 0.0, gain = 1.0;
  };
  FolderCamera(const Options& options, FolderWatch watch) : options_(options), watch_(std::move(watch)) {}
  absl::Status find_first();
  // The next complete file that is a picture, with the size and settings of the first one.
  std::optional<Picture> next_picture();
  // DATA_LOSS: it cannot be read, perhaps only not yet; FAILED_PRECONDITION: its exposure is unknown.
  absl::StatusOr<Picture> read(const std::filesystem::path& path, std::string_view bytes) const;
  absl::Status check_like_first(const Picture& picture) const;
  void shoot();  // runs the command; one that still runs is ended first
  void note_problem(const std::string& problem);

  const Options options_;
  FolderWatch watch_;               // of the thread that calls start(), next() and stop()
  std::deque<std::string> newest_;  // checksums of the newest files; likewise
  std::optional<Picture> first_;    // once it is open; without its image
  std::vector<std::string> words_;  // of the command
  mutable std::mutex mutex_;
  bool running_ = false;       // guarded by mutex_
  std::int64_t sequence_ = 0;  // guarded by mutex_
  struct Due {
    std::string what, problem;
    nanoseconds since{};
  };
  std::optional<Due> due_;  // guarded by mutex_
  nanoseconds started_{};   // guarded by mutex_
  int files_ = 0;           // that came since; guarded by mutex_
  std::string problem_;     // of the last command or file, before a picture is due; guarded by mutex_
  std::jthread shooting_;   // guarded by mutex_
};

}  // namespace glasswing
