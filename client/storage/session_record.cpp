#include "client/storage/session_record.h"

#include <fmt/format.h>
#include <google/protobuf/util/json_util.h>

#include <nlohmann/json.hpp>

#include "core/base/status.h"
#include "core/file/file.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

constexpr char kRecord[] = "session.json";

}  // namespace

absl::Status write_session_record(const SessionRecord& record, const fs::path& directory) {
  google::protobuf::util::JsonPrintOptions options;
  options.preserve_proto_field_names = true;
  std::string session;
  if (const auto printed = google::protobuf::util::MessageToJsonString(record.session, &session, options);
      !printed.ok())
    return absl::InternalError(std::string(printed.message()));
  const nlohmann::ordered_json json = {{"session", nlohmann::ordered_json::parse(session)},
                                       {"computes", record.computes}};
  return write_file_durably(directory / kRecord, json.dump(1) + "\n");
}

absl::StatusOr<SessionRecord> read_session_record(const fs::path& directory) {
  const fs::path path = directory / kRecord;
  GW_ASSIGN_OR_RETURN(const std::string text, read_file(path));
  const nlohmann::json json = nlohmann::json::parse(text, nullptr, false);
  if (json.is_object() && json.contains("session") && json.contains("computes") &&
      json["computes"].is_string()) {
    SessionRecord record{.session = {}, .computes = json["computes"]};
    google::protobuf::util::JsonParseOptions options;
    options.ignore_unknown_fields = true;
    const auto parsed =
        google::protobuf::util::JsonStringToMessage(json["session"].dump(), &record.session, options);
    if (parsed.ok()) return record;
  }
  return absl::DataLossError(fmt::format("{} is no record of a session", path.string()));
}

}  // namespace glasswing
