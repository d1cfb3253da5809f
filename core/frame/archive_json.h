// The JSON of an archive's header, journal and manifest (docs/archive.md).
#pragma once

#include <absl/status/status.h>
#include <google/protobuf/message.h>

#include <filesystem>
#include <string>
#include <string_view>

namespace glasswing {

// The message's members, and one more, "record_checksum": that of all the text before it. So whatever happens
// to a byte of it is noticed.
std::string archive_json(const google::protobuf::Message& message, bool indented);

// DATA_LOSS names the path: it is no such message, or its text is not what its checksum is of. Text without a
// checksum (of other programs) is taken as it is; fields that are not known are passed over.
absl::Status parse_archive_json(std::string_view json, const std::filesystem::path& path,
                                google::protobuf::Message* message);

// How much of a text is a whole record, up to the brace after its checksum; 0: none is.
size_t whole_record(std::string_view text);

}  // namespace glasswing
