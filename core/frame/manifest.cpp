// Validation of manifests from any source.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "core/base/status.h"
#include "core/frame/archive.h"

namespace glasswing {
namespace {

constexpr size_t kMaxName = 255;  // bytes, of a frame's file
constexpr double kMaxBlack = 0.9;

// The path and value of the first number in `message` that is not finite; empty if there is none.
std::string find_not_finite(const google::protobuf::Message& message) {
  using Field = google::protobuf::FieldDescriptor;
  const google::protobuf::Reflection& reflection = *message.GetReflection();
  std::vector<const Field*> fields;
  reflection.ListFields(message, &fields);
  for (const Field* field : fields) {
    const bool repeated = field->is_repeated();
    const int count = repeated ? reflection.FieldSize(message, field) : 1;
    for (int i = 0; i < count; ++i) {
      const std::string name = repeated ? fmt::format("{}[{}]", field->name(), i) : field->name();
      if (field->cpp_type() == Field::CPPTYPE_DOUBLE) {
        const double value =
            repeated ? reflection.GetRepeatedDouble(message, field, i) : reflection.GetDouble(message, field);
        if (!std::isfinite(value)) return fmt::format("{} is {}", name, value);
      } else if (field->cpp_type() == Field::CPPTYPE_MESSAGE) {
        const std::string below = find_not_finite(repeated ? reflection.GetRepeatedMessage(message, field, i)
                                                           : reflection.GetMessage(message, field));
        if (!below.empty()) return name + "." + below;
      }
    }
  }
  return "";
}

absl::Status impossible(const std::string& what) {
  return absl::InvalidArgumentError(what);
}

absl::Status check_finite(const std::string& what, const google::protobuf::Message& message) {
  const std::string found = find_not_finite(message);
  if (found.empty()) return absl::OkStatus();
  return impossible(fmt::format("{}: {}; it must be finite", what, found));
}

bool good_side(int side) {
  return side >= 1 && side <= kMaxSide_px;
}

}  // namespace

absl::Status check_manifest_header(const v1::CaptureManifest& manifest) {
  const v1::Camera& camera = manifest.camera();
  if (!good_side(camera.width_px()) || !good_side(camera.height_px())) {
    return impossible(fmt::format("the camera's size is {}x{}; each side must be 1 to {} px",
                                  camera.width_px(), camera.height_px(), kMaxSide_px));
  }
  if (camera.read_sd() < 0.0 || camera.gain() < 0.0) {
    return impossible(fmt::format("the camera's read_sd is {} and its gain {}; they must be 0 or more",
                                  camera.read_sd(), camera.gain()));
  }
  if (!(camera.black_level() >= 0.0 && camera.black_level() <= kMaxBlack)) {
    return impossible(
        fmt::format("the camera's black_level is {}; it must be 0 to {}", camera.black_level(), kMaxBlack));
  }
  if (!camera.mosaic().empty()) GW_RETURN_IF_ERROR(Mosaic::parse(camera.mosaic()).status());
  if (manifest.monitors_size() > kMaxMonitors) {
    return impossible(fmt::format("it names {} monitors; at most {} are supported", manifest.monitors_size(),
                                  kMaxMonitors));
  }
  std::set<std::string> names;
  for (const v1::Monitor& monitor : manifest.monitors()) {
    if (monitor.name().empty() || !good_side(monitor.width_px()) || !good_side(monitor.height_px())) {
      return impossible(fmt::format("monitor \"{}\" is {}x{}; each side must be 1 to {} px", monitor.name(),
                                    monitor.width_px(), monitor.height_px(), kMaxSide_px));
    }
    if (!names.insert(monitor.name()).second) {
      return impossible(fmt::format("it names monitor \"{}\" twice", monitor.name()));
    }
  }
  for (const v1::Monitor& monitor : manifest.monitors())
    GW_RETURN_IF_ERROR(check_finite("monitor \"" + monitor.name() + "\"", monitor));
  for (const auto& [axis, position] : manifest.axes()) {
    if (!std::isfinite(position))
      return impossible(fmt::format("axis \"{}\" is at {}; it must be finite", axis, position));
  }
  GW_RETURN_IF_ERROR(check_finite("camera", camera));
  return check_finite("plan", manifest.plan());
}

absl::StatusOr<size_t> listed_bytes(const v1::Frame& frame, const FrameShape& shape, std::string_view file) {
  const size_t plain_bytes = tiff_size_bytes(shape);
  const size_t size_bytes = frame.size_bytes() > 0 ? static_cast<size_t>(frame.size_bytes()) : plain_bytes;
  if (size_bytes <= plain_bytes) return size_bytes;
  return absl::DataLossError(fmt::format("{} is listed with {} bytes; a frame of this camera has at most {}",
                                         file, size_bytes, plain_bytes));
}

absl::Status check_frame(const v1::Frame& frame) {
  const std::filesystem::path file(frame.file());
  const bool climbs = std::find(file.begin(), file.end(), "..") != file.end();
  const bool control = std::any_of(frame.file().begin(), frame.file().end(),
                                   [](char c) { return static_cast<unsigned char>(c) < 0x20; });
  if (file.empty() || file.is_absolute() || climbs || control || frame.file().size() > kMaxName) {
    return impossible(fmt::format("a frame's file is \"{}\"; it must be inside the archive",
                                  frame.file().substr(0, kMaxName)));
  }
  if (frame.size_bytes() < 0) {
    return impossible(
        fmt::format("{}: size_bytes is {}; it must be 0 or more", frame.file(), frame.size_bytes()));
  }
  return check_finite(frame.file(), frame);
}

absl::Status check_manifest(const v1::CaptureManifest& manifest) {
  if (manifest.format_version() != 1) {
    return impossible(fmt::format("format_version is {}; this program reads 1", manifest.format_version()));
  }
  GW_RETURN_IF_ERROR(check_manifest_header(manifest));
  if (manifest.monitors().empty()) return impossible("it names no monitorsssssssss");
  if (manifest.frames().empty()) return impossible("it lists no frames");
  std::set<std::string> files;
  for (const v1::Frame& frame : manifest.frames()) {
    GW_RETURN_IF_ERROR(check_frame(frame));
    if (!files.insert(frame.file()).second) {
      return impossible(fmt::format("the frame {} is listed twice", frame.file()));
    }
  }
  return absl::OkStatus();
}

}  // namespace glasswing
