#include "server/fsck/check_server.h"

#include <fmt/format.h>
#include <google/protobuf/util/json_util.h>

#include <algorithm>
#include <set>

#include "core/base/status.h"
#include "core/file/file.h"
#include "core/matte/matte_file.h"
#include "core/method/methods.h"
#include "glasswing/v1/calibration.pb.h"
#include "server/fsck/server_records.h"
#include "server/storage/image_name.h"
#include "server/storage/matte_files.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

class ServerCheck {
 public:
  ServerCheck(fs::path data, Check& check) : data_(std::move(data)), check_(check), records_(data_) {}

  void run() {
    records_.open(check_);
    for (const SessionRecord& record : records_.sessions()) check_mattes_of(record);
    for (const TileRecord& tile : records_.tiles_of_solves()) check_tile(tile);
    for (const char* directory : {"mattes", "tiles"}) check_strangers(data_ / directory);
    check_each(data_ / "images", [this](const fs::path& file) { check_image(file); });
    check_each(data_ / "calibration", [this](const fs::path& file) { check_calibration(file); });
    check_server_id();
    check_leftovers(data_, check_);
  }

 private:
  template <typename Use>
  static void check_each(const fs::path& directory, const Use& use) {
    std::error_code error;
    std::set<fs::path> entries;
    for (const fs::directory_entry& entry : fs::directory_iterator(directory, error))
      entries.insert(entry.path());
    for (const fs::path& entry : entries) use(entry);
  }

  absl::Status verify(const fs::path& matte) {
    GW_ASSIGN_OR_RETURN(const std::string bytes, check_.read(matte));
    return verify_matte(bytes);
  }
  absl::Status set_aside_if_there(const fs::path& path) {
    return fs::exists(path) ? set_aside(data_, path) : absl::OkStatus();
  }

  // The file that the server would serve: the next one, if it is about to replace the finished one.
  fs::path finished_file(const v1::Session& session) const {
    const fs::path next = files_.next(session.name());
    const bool pending = session.state() == v1::SESSION_STATE_DONE && fs::exists(next);
    return pending ? next : files_.finished(session.name());
  }
  fs::path frame_file(const v1::Session& session, int frame) const {
    const fs::path next = files_.next(session.name(), frame);
    const bool pending = !session.matte_ready() ||
                         (session.state() == v1::SESSION_STATE_DONE && fs::exists(next.parent_path()));
    return pending ? next : files_.finished(session.name(), frame);
  }

  void check_mattes_of(const SessionRecord& record) {
    const v1::Session& session = record.session;
    const bool is_anew = session.matte_ready() && session.state() != v1::SESSION_STATE_DONE;
    if (is_anew && !record.finished) return;  // the server would not serve it either
    const v1::Session& made = is_anew ? *record.finished : session;
    if (made.frame_count() > 0 && made.method() == kRampMethod) {
      for (const int frame : std::vector<int>(made.solved_frames().begin(), made.solved_frames().end()))
        check_frame_matte(session.name(), frame, frame_file(session, frame));
    } else if (session.matte_ready()) {
      check_matte(session.name(), finished_file(session));
    }
  }

  SessionRecord current(const std::string& name) const {
    return *std::ranges::find(records_.sessions(), name,
                              [](const SessionRecord& record) { return record.session.name(); });
  }

  void check_matte(const std::string& name, const fs::path& file) {
    const absl::Status status = verify(file);
    if (status.ok()) return;
    check_.found(
        {.file = file.string(),
         .what = std::string(status.message()),
         .meaning = fmt::format("the matte of session \"{}\" cannot be fetched; solve it again from its "
                                "frames",
                                name),
         .repair = fmt::format("it is set aside, and the session can be solved again: glasswing solve "
                               "{}",
                               name)},
        [&]() -> absl::Status {
          SessionRecord record = current(name);
          record.finished.reset();
          record.session.set_matte_ready(false);
          if (record.session.state() == v1::SESSION_STATE_DONE) {
            record.session.set_state(v1::SESSION_STATE_CAPTURED);
            record.session.set_reason("its matte was damaged; solve it again: glasswing solve " + name);
          }
          GW_RETURN_IF_ERROR(records_.update(record));
          return set_aside_if_there(file);
        });
  }

  void check_frame_matte(const std::string& name, int frame, const fs::path& file) {
    const absl::Status status = verify(file);
    if (status.ok()) return;
    check_.found(
        {.file = file.string(),
         .what = std::string(status.message()),
         .meaning = fmt::format("the matte of frame {} of session \"{}\" cannot be fetched; the others can",
                                frame, name),
         .repair =
             "it is set aside and counts as not solved; a solve in progress solves it again, otherwise: "
             "glasswing solve " +
             name},
        [&]() -> absl::Status {
          lost_.insert({name, frame});
          SessionRecord record = current(name);
          for (v1::Session* made : {&record.session, record.finished ? &*record.finished : nullptr}) {
            if (made == nullptr) continue;
            auto& solved = *made->mutable_solved_frames();
            solved.erase(std::remove_if(solved.begin(), solved.end(),
                                        [&](int one) {
                                          return lost_.contains({name, one});
                                        }),
                         solved.end());
          }
          GW_RETURN_IF_ERROR(records_.update(record));
          if (!record.session.matte_ready() && record.session.job() != 0)
            GW_RETURN_IF_ERROR(records_.queue_again(record.session.job(), frame));
          return set_aside_if_there(file);
        });
  }

  void check_tile(const TileRecord& tile) {
    const fs::path file = data_ / "tiles" / tile.session / tile.result;
    const absl::StatusOr<std::string> bytes = check_.read(file);
    absl::Status status = bytes.status();
    if (status.ok() && !is_named_after(file, *bytes))
      status = absl::DataLossError("the checksum in its name does not match its bytes");
    if (status.ok()) return;
    check_.found(
        {.file = file.string(),
         .what = std::string(status.message()),
         .meaning = fmt::format("the solve of session \"{}\" cannot be finished with it", tile.session),
         .repair = "it is set aside, and the tile is solved again"},
        [&]() -> absl::Status {
          GW_RETURN_IF_ERROR(records_.queue_again(tile));
          return set_aside_if_there(file);
        });
  }

  // Mattes and tiles of sessions missing in the catalogue.
  void check_strangers(const fs::path& directory) {
    check_each(directory, [&](const fs::path& path) {
      if (path.extension() == ".tmp") return;
      std::string name = path.filename().string();
      if (fs::is_regular_file(path) && name.ends_with(".exr")) name.resize(name.size() - 4);
      name = name.substr(0, name.find('+'));
      if (records_.knows(name)) return;
      check_.found({.file = path.string(),
                    .what = fmt::format("the catalogue has no session \"{}\"", name),
                    .meaning = "the session was deleted, or an older catalogue was restored",
                    .repair = "it is set aside",
                    .is_damage = false},
                   [&] { return set_aside(data_, path); });
    });
  }

  void check_image(const fs::path& file) {
    if (file.extension() == ".tmp") return;
    const absl::StatusOr<std::string> bytes = check_.read(file);
    if (bytes.ok() && image_name(*bytes) == file.filename()) return;
    check_.found({.file = file.string(),
                  .what = bytes.ok() ? "the checksum in its name does not match its bytes"
                                     : std::string(bytes.status().message()),
                  .meaning = "a session whose plan shows this photo cannot be captured",
                  .repair = "it is set aside; the next glasswing capture with the photo uploads it again"},
                 [&] { return set_aside(data_, file); });
  }

  void check_calibration(const fs::path& file) {
    const std::string name = file.filename().string();
    if (!name.ends_with(".json")) return;
    v1::CameraCalibration camera;
    v1::DisplayCalibration display;
    v1::SyncCalibration sync;
    const bool of_camera = name.starts_with("camera-"), of_display = name.starts_with("monitor-");
    if (!of_camera && !of_display && name != "sync.json") return;
    google::protobuf::Message* message = &sync;
    if (of_camera) message = &camera;
    if (of_display) message = &display;
    const absl::StatusOr<std::string> json = check_.read(file);
    absl::Status status = json.status();
    if (json.ok()) {
      const auto parsed = google::protobuf::util::JsonStringToMessage(*json, message);
      if (!parsed.ok()) status = absl::DataLossError(std::string(parsed.message()));
    }
    if (status.ok()) return;
    check_.found({.file = file.string(),
                  .what = std::string(status.message()),
                  .meaning = "the server sets it aside when it starts, and works without it",
                  .repair = fmt::format("it is set aside; measure again: glasswing calibrate {}",
                                        of_camera    ? "camera"
                                        : of_display ? "display"
                                                     : "sync")},
                 [&] { return set_aside(data_, file); });
  }

  void check_server_id() {
    const fs::path file = data_ / "server-id";
    if (!fs::exists(file)) return;  // the server makes one
    const absl::StatusOr<std::string> id = check_.read(file);
    const bool good =
        id.ok() && id->size() == 32 && id->find_first_not_of("0123456789abcdef") == std::string::npos;
    if (good) return;
    check_.found({.file = file.string(),
                  .what = "it does not contain 32 hexadecimal digits",
                  .meaning = "a job store that several servers share does not recognise this server; its "
                             "solves in progress there must be requested again",
                  .repair = "it is set aside, and the server creates a new one"},
                 [&] { return set_aside(data_, file); });
  }

  const fs::path data_;
  Check& check_;
  ServerRecords records_;
  const MatteFiles files_{data_};
  std::set<std::pair<std::string, int>> lost_;  // frames' mattes, by session
};

}  // namespace

void check_server(const fs::path& directory, Check& check) {
  ServerCheck(directory, check).run();
}

}  // namespace glasswing
