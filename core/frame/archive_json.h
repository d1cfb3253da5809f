// The JSON of an archive's header, journal and manifest (docs/archive.md).
#pragma once

#include <absl/status/status.h>
#include <google/protobuf/message.h>

#include <filesystem>
#include <string>
#include <string_view>

namespace glasswing {

// The message's members, followed by "record_checksum", the checksum of all text before it, so that a change
// of any byte is detected.
std::string archive_json(const google::protobuf::Message& message, bool indented);

// Text without a checksum (from other programs) is accepted; unknown fields are ignored. DATA_LOSS names the
// path: the text is not such a message, or does not match its checksum.
absl::Status parse_archive_json(std::string_view json, const std::filesystem::path& path,
                                google::protobuf::Message* message);

// The length of the complete record that `text` starts with, up to the brace after its checksum; 0: none.
size_t whole_record(std::string_view text);

}  // namespace glasswing
