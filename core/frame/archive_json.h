// The JSON of an archive's header, journal and manifest (docs/archive.md).
#pragma once

#include <absl/status/status.h>
#include <google/protobuf/message.h>

#include <filesystem>
#include <string>
#include <string_view>

namespace glasswing {

std::string archive_json(const google::protobuf::Message& message, bool indented);
// DATA_LOSS names the path. Fields that are not known are passed over.
absl::Status parse_archive_json(std::string_view json, const std::filesystem::path& path,
                                google::protobuf::Message* message);

}  // namespace glasswing
