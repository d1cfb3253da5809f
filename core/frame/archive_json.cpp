#include "core/frame/archive_json.h"

#include <fmt/format.h>
#include <google/protobuf/util/json_util.h>

#include <regex>

#include "core/base/checksum.h"

namespace glasswing {
namespace {

constexpr std::string_view kMember = "\"record_checksum\"";

// A record's checksum; `begin` is at the comma before it, npos: there is none.
struct Seal {
  size_t begin = std::string_view::npos, end = 0;
  std::string checksum = {};
};

Seal seal_of(std::string_view text) {
  static const std::regex kSeal(",\\s*\"record_checksum\"\\s*:\\s*\"(xxh3:[0-9a-f]{16})\"\\s*\\}");
  const size_t member = text.rfind(kMember);
  const size_t comma = member == std::string_view::npos ? member : text.rfind(',', member);
  std::cmatch found;
  if (comma == std::string_view::npos ||
      !std::regex_search(text.data() + comma, text.data() + text.size(), found, kSeal,
                         std::regex_constants::match_continuous))
    return {};
  return {.begin = comma, .end = comma + static_cast<size_t>(found.length(0)), .checksum = found.str(1)};
}

}  // namespace

std::string archive_json(const google::protobuf::Message& message, bool indented) {
  google::protobuf::util::JsonPrintOptions options;
  options.add_whitespace = indented;
  options.preserve_proto_field_names = true;
  std::string json;
  // Fails only for messages that hold invalid Any or Timestamp values; ours have none.
  (void)google::protobuf::util::MessageToJsonString(message, &json, options);
  const size_t last = json.find_last_not_of("\n ", json.rfind('}') - 1);  // end of the last member
  if (json[last] == '{') return json;                                     // no members
  json.resize(last + 1);
  return json + fmt::format("{}{}: \"{}\"{}", indented ? ",\n " : ",", kMember, checksum_of(json),
                            indented ? "\n}\n" : "}");
}

absl::Status parse_archive_json(std::string_view json, const std::filesystem::path& path,
                                google::protobuf::Message* message) {
  const Seal seal = seal_of(json);
  if (seal.end > 0 && seal.checksum != checksum_of(json.substr(0, seal.begin))) {
    return absl::DataLossError(
        fmt::format("{} is damaged: a record's checksum is not {}", path.string(), seal.checksum));
  }
  google::protobuf::util::JsonParseOptions options;
  options.ignore_unknown_fields = true;
  const auto status =
      google::protobuf::util::JsonStringToMessage({json.data(), json.size()}, message, options);
  if (status.ok()) return absl::OkStatus();
  return absl::DataLossError(fmt::format("{}: {}", path.string(), std::string(status.message())));
}

size_t whole_record(std::string_view text) {
  const Seal seal = seal_of(text);
  return seal.end > 0 && seal.checksum == checksum_of(text.substr(0, seal.begin)) ? seal.end : 0;
}

}  // namespace glasswing
