#include "core/import/foreign_manifest.h"

#include <fmt/format.h>
#include <google/protobuf/util/json_util.h>

#include <cmath>
#include <functional>
#include <nlohmann/json.hpp>

#include "core/base/status.h"
#include "core/file/file.h"
#include "core/frame/archive.h"
#include "core/frame/archive_json.h"

namespace glasswing {
namespace {

using Json = nlohmann::ordered_json;              // keeps the order of monitors
constexpr std::uintmax_t kMaxBytes = 256u << 20;  // of manifest.json; enough for a million frames
constexpr int kMaxDepth = 64;                     // nesting levels; four are needed

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

// These manifests use the field names of Stimulus, so protobuf's JSON parser reads an entry.
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

// A raw sensor: {"cfa": "RGGB", "sensor": {"bits": 12, "black_level": 256, "full_well_e": 20000,
// "read_noise_sd": 0.003}}, all of which may be omitted. Codes of black are of `bits`, noise is of full
// scale.
absl::Status translate_sensor(const Json& json, const std::filesystem::path& path, v1::Camera& camera) {
  if (json.contains("cfa")) {
    if (!json["cfa"].is_string()) return bad(path, "cfa is not a string, such as \"RGGB\"");
    camera.set_mosaic(json["cfa"].get<std::string>());
  }
  const Json sensor = json.value("sensor", Json::object());
  const auto number = [&](const char* key, double low, double high) -> absl::StatusOr<double> {
    if (!sensor.is_object() || !sensor.contains(key)) return 0.0;
    if (sensor[key].is_number() && sensor[key].get<double>() >= low && sensor[key].get<double>() <= high)
      return sensor[key].get<double>();
    return bad(path, fmt::format("sensor.{} is {}; it must be {} to {}", key,
                                 sensor[key].dump().substr(0, 32), low, high));
  };
  GW_ASSIGN_OR_RETURN(const double bits, number("bits", 1.0, 16.0));
  GW_ASSIGN_OR_RETURN(const double black, number("black_level", 0.0, 65535.0));
  GW_ASSIGN_OR_RETURN(const double electrons, number("full_well_e", 1.0, 1e9));
  GW_ASSIGN_OR_RETURN(const double read_sd, number("read_noise_sd", 0.0, 1.0));
  if (bits > 0.0) camera.set_bits(static_cast<int>(bits));
  camera.set_black_level(black / (std::exp2(camera.bits()) - 1.0));
  camera.set_read_sd(read_sd);
  if (electrons > 0.0) camera.set_gain(1.0 / electrons);
  return absl::OkStatus();
}

// Everything except the frames.
absl::StatusOr<v1::CaptureManifest> translate_header(const Json& json, const std::filesystem::path& path) {
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
  GW_RETURN_IF_ERROR(translate_sensor(json, path, *manifest.mutable_camera()));
  return manifest;
}

absl::StatusOr<v1::CaptureManifest> translate(const Json& json, const std::filesystem::path& path) {
  GW_ASSIGN_OR_RETURN(v1::CaptureManifest manifest, translate_header(json, path));
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
      return bad(path, fmt::format("{} ({}) lacks \"object\": true or false", where, frame.file()));
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

// Parses manifest.json and passes it to `make`; errors name the path.
absl::StatusOr<v1::CaptureManifest> read_manifest(
    const std::filesystem::path& path,
    const std::function<absl::StatusOr<v1::CaptureManifest>(const Json&, const std::string& text)>& make) {
  std::error_code unknown;
  const std::uintmax_t size_bytes = std::filesystem::file_size(path, unknown);
  if (!unknown && size_bytes > kMaxBytes) {
    return bad(path, fmt::format("it has {} bytes; at most {} are supported", size_bytes, kMaxBytes));
  }
  GW_ASSIGN_OR_RETURN(const std::string text, read_file(path));
  try {
    // The parser recurses as deep as the text nests, so deeper values are dropped while parsing.
    bool too_deep = false;
    const Json json = Json::parse(text, [&](int depth, Json::parse_event_t, const Json&) {
      too_deep = too_deep || depth > kMaxDepth;
      return depth <= kMaxDepth;
    });
    if (too_deep) return bad(path, fmt::format("it is nested more than {} deep", kMaxDepth));
    if (!json.is_object()) return bad(path, "it is not a JSON object");
    return make(json, text);
  } catch (const Json::exception& error) {
    return absl::DataLossError(fmt::format("{}: {}", path.string(), error.what()));
  }
}

}  // namespace

absl::StatusOr<v1::CaptureManifest> read_any_manifest(const std::filesystem::path& directory) {
  const std::filesystem::path path = directory / "manifest.json";
  const auto make = [&](const Json& json, const std::string& text) -> absl::StatusOr<v1::CaptureManifest> {
    if (!json.contains("format_version")) return translate(json, path);
    v1::CaptureManifest manifest;
    GW_RETURN_IF_ERROR(parse_archive_json(text, path, &manifest));
    return manifest;
  };
  GW_ASSIGN_OR_RETURN(v1::CaptureManifest manifest, read_manifest(path, make));
  if (const absl::Status status = check_manifest(manifest); !status.ok())
    return bad(path, std::string(status.message()));
  return manifest;
}

absl::StatusOr<v1::CaptureManifest> read_sequences_header(const std::filesystem::path& directory) {
  const std::filesystem::path path = directory / "manifest.json";
  const auto make = [&](const Json& json, const std::string&) -> absl::StatusOr<v1::CaptureManifest> {
    if (json.contains("format_version"))
      return bad(path, "it belongs to an archive with a single list of frames, without sequences");
    return translate_header(json, path);
  };
  GW_ASSIGN_OR_RETURN(v1::CaptureManifest manifest, read_manifest(path, make));
  if (const absl::Status status = check_manifest_header(manifest); !status.ok())
    return bad(path, std::string(status.message()));
  return manifest;
}

}  // namespace glasswing
