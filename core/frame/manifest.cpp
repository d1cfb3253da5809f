// Manifests that users bring: ours as they are, others translated entry by entry.
#include <fmt/format.h>
#include <google/protobuf/util/json_util.h>

#include <nlohmann/json.hpp>

#include "core/base/file.h"
#include "core/base/status.h"
#include "core/frame/archive.h"

namespace glasswing {
namespace {

using Json = nlohmann::ordered_json;  // keeps the file's order of monitors
constexpr int kMaxSide_px = 16384;

absl::Status bad(const std::filesystem::path& path, const std::string& what) {
  return absl::InvalidArgumentError(fmt::format("{}: {}", path.string(), what));
}

absl::StatusOr<int> side_of(const Json& object, const char* key, const std::string& where,
                            const std::filesystem::path& path) {
  if (!object.is_object() || !object.contains(key) || !object[key].is_number_integer() ||
      object[key].get<std::int64_t>() < 1 || object[key].get<std::int64_t>() > kMaxSide_px) {
    return bad(path, fmt::format("{} has no {} of 1 to {} px", where, key, kMaxSide_px));
  }
  return object[key].get<int>();
}

// The fields of Stimulus have the names used there, so protobuf's own reader translates an entry.
absl::StatusOr<v1::Stimulus> stimulus_of(const Json& entry, const std::string& where,
                                         const std::filesystem::path& path) {
  v1::Stimulus stimulus;
  if (!entry.is_object()) return bad(path, fmt::format("{} has no stimulus", where));
  google::protobuf::util::JsonParseOptions options;
  options.ignore_unknown_fields = true;
  const auto status = google::protobuf::util::JsonStringToMessage(entry.dump(), &stimulus, options);
  if (!status.ok()) return bad(path, fmt::format("{}: {}", where, std::string(status.message())));
  if (stimulus.kind().empty()) return bad(path, fmt::format("{}: the stimulus has no kind", where));
  return stimulus;
}

absl::StatusOr<v1::CaptureManifest> translate(const Json& json, const std::filesystem::path& path) {
  v1::CaptureManifest manifest;
  manifest.set_format_version(1);
  if (json.contains("scene") && json["scene"].is_string())
    manifest.set_scene(json["scene"].get<std::string>());
  if (!json.contains("monitor") || !json["monitor"].is_object() || json["monitor"].empty()) {
    return bad(path, "it has no monitor: {\"name\": {\"width\": ..., \"height\": ...}}");
  }
  for (const auto& [name, size] : json["monitor"].items()) {
    v1::Monitor& monitor = *manifest.add_monitors();
    monitor.set_name(name);
    monitor.set_response("linear");
    const std::string where = fmt::format("monitor \"{}\"", name);
    GW_ASSIGN_OR_RETURN(const int width, side_of(size, "width", where, path));
    GW_ASSIGN_OR_RETURN(const int height, side_of(size, "height", where, path));
    monitor.set_width_px(width);
    monitor.set_height_px(height);
  }
  const Json image = json.value("image", Json::object());
  GW_ASSIGN_OR_RETURN(const int width, side_of(image, "width", "image", path));
  GW_ASSIGN_OR_RETURN(const int height, side_of(image, "height", "image", path));
  manifest.mutable_camera()->set_width_px(width);
  manifest.mutable_camera()->set_height_px(height);
  manifest.mutable_camera()->set_bits(16);
  manifest.mutable_camera()->set_response("linear");
  if (!json.contains("frames") || !json["frames"].is_array() || json["frames"].empty()) {
    return bad(path, "it lists no frames");
  }
  for (size_t i = 0; i < json["frames"].size(); ++i) {
    const Json& entry = json["frames"][i];
    const std::string where = fmt::format("frame {}", i);
    if (!entry.is_object() || !entry.contains("file") || !entry["file"].is_string()) {
      return bad(path, fmt::format("{} has no file", where));
    }
    v1::Frame& frame = *manifest.add_frames();
    frame.set_file(entry["file"].get<std::string>());
    if (!entry.contains("object") || !entry["object"].is_boolean()) {
      return bad(path, fmt::format("{} ({}) does not say \"object\": true or false", where, frame.file()));
    }
    frame.set_object(entry["object"].get<bool>());
    frame.set_step(-1);
    frame.set_proof(v1::PROOF_IMPORTED);
    const Json stimulus = entry.value("stimulus", Json());
    GW_ASSIGN_OR_RETURN(*frame.mutable_stimulus(),
                        stimulus_of(stimulus, where + " (" + frame.file() + ")", path));
  }
  return manifest;
}

absl::Status check(const v1::CaptureManifest& manifest, const std::filesystem::path& path) {
  if (manifest.format_version() != 1) {
    return bad(path, fmt::format("format_version is {}; this program reads 1", manifest.format_version()));
  }
  const auto good_side = [](int side) { return side >= 1 && side <= kMaxSide_px; };
  if (!good_side(manifest.camera().width_px()) || !good_side(manifest.camera().height_px())) {
    return bad(path, fmt::format("the camera's size is {}x{}; each side must be 1 to {} px",
                                 manifest.camera().width_px(), manifest.camera().height_px(), kMaxSide_px));
  }
  if (manifest.monitors().empty()) return bad(path, "it names no monitor");
  if (manifest.frames().empty()) return bad(path, "it lists no frames");
  for (const v1::Monitor& monitor : manifest.monitors()) {
    if (monitor.name().empty() || !good_side(monitor.width_px()) || !good_side(monitor.height_px())) {
      return bad(path, fmt::format("monitor \"{}\" is {}x{}; each side must be 1 to {} px", monitor.name(),
                                   monitor.width_px(), monitor.height_px(), kMaxSide_px));
    }
  }
  std::set<std::string> files;
  for (const v1::Frame& frame : manifest.frames()) {
    const std::filesystem::path file(frame.file());
    const bool climbs = std::find(file.begin(), file.end(), "..") != file.end();
    if (file.empty() || file.is_absolute() || climbs) {
      return bad(path, fmt::format("a frame's file is \"{}\"; it must lie below the archive", frame.file()));
    }
    if (!files.insert(frame.file()).second) {
      return bad(path, fmt::format("the frame {} is listed twice", frame.file()));
    }
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<v1::CaptureManifest> read_any_manifest(const std::filesystem::path& directory) {
  const std::filesystem::path path = directory / "manifest.json";
  GW_ASSIGN_OR_RETURN(const std::string text, read_file(path));
  v1::CaptureManifest manifest;
  try {
    const Json json = Json::parse(text);
    if (!json.is_object()) return bad(path, "it is not a JSON object");
    if (json.contains("format_version")) {
      google::protobuf::util::JsonParseOptions options;
      options.ignore_unknown_fields = true;
      const auto status = google::protobuf::util::JsonStringToMessage(text, &manifest, options);
      if (!status.ok())
        return absl::DataLossError(fmt::format("{}: {}", path.string(), std::string(status.message())));
    } else {
      GW_ASSIGN_OR_RETURN(manifest, translate(json, path));
    }
  } catch (const Json::exception& error) {
    return absl::DataLossError(fmt::format("{}: {}", path.string(), error.what()));
  }
  GW_RETURN_IF_ERROR(check(manifest, path));
  return manifest;
}

}  // namespace glasswing
