#include "client/exchange/partial_directory.h"

#include <fmt/format.h>
#include <google/protobuf/util/json_util.h>
#include <unistd.h>

#include "core/base/status.h"
#include "core/file/file.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

absl::Status write_manifest(const v1::CaptureManifest& manifest, const fs::path& path) {
  google::protobuf::util::JsonPrintOptions options;
  options.add_whitespace = true;
  options.preserve_proto_field_names = true;
  std::string json;
  const auto status = google::protobuf::util::MessageToJsonString(manifest, &json, options);
  if (!status.ok())
    return absl::InternalError(fmt::format("{}: {}", path.string(), std::string(status.message())));
  return write_file_durably(path, json);
}

}  // namespace

absl::StatusOr<std::unique_ptr<PartialDirectory>> PartialDirectory::create(fs::path target) {
  target = fs::absolute(target).lexically_normal();
  if (!target.has_filename()) target = target.parent_path();
  std::error_code error;
  if (fs::exists(target, error) && !(fs::is_directory(target, error) && fs::is_empty(target, error))) {
    return absl::AlreadyExistsError(
        fmt::format("{} already exists; it must be a new or empty directory", target.string()));
  }
  fs::path partial = fmt::format("{}.partial-{}", target.string(), ::getpid());
  if (!fs::create_directories(partial / "frames", error)) {
    return absl::ErrnoToStatus(error.value(), "cannot create " + partial.string());
  }
  return std::unique_ptr<PartialDirectory>(new PartialDirectory(std::move(target), std::move(partial)));
}

PartialDirectory::~PartialDirectory() {
  std::error_code ignored;
  fs::remove_all(partial_, ignored);
}

absl::Status PartialDirectory::keep(const v1::CaptureManifest& manifest) {
  GW_RETURN_IF_ERROR(flush_directory(partial_ / "frames"));
  GW_RETURN_IF_ERROR(write_manifest(manifest, partial_ / "manifest.json"));
  GW_RETURN_IF_ERROR(rename_file(partial_, target_));
  return flush_directory(target_.parent_path());
}

}  // namespace glasswing
