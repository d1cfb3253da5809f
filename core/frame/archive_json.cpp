#include "core/frame/archive_json.h"

#include <fmt/format.h>
#include <google/protobuf/util/json_util.h>

namespace glasswing {

std::string archive_json(const google::protobuf::Message& message, bool indented) {
  google::protobuf::util::JsonPrintOptions options;
  options.add_whitespace = indented;
  options.preserve_proto_field_names = true;
  std::string json;
  // Fails only for messages that hold invalid Any or Timestamp values; ours have none.
  (void)google::protobuf::util::MessageToJsonString(message, &json, options);
  return json;
}

absl::Status parse_archive_json(std::string_view json, const std::filesystem::path& path,
                                google::protobuf::Message* message) {
  google::protobuf::util::JsonParseOptions options;
  options.ignore_unknown_fields = true;
  const auto status =
      google::protobuf::util::JsonStringToMessage({json.data(), json.size()}, message, options);
  if (status.ok()) return absl::OkStatus();
  return absl::DataLossError(fmt::format("{}: {}", path.string(), std::string(status.message())));
}

}  // namespace glasswing
