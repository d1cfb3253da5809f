#include "core/matte/matte_notes.h"

#include <fmt/format.h>

#include <algorithm>
#include <iostream>
#include <nlohmann/json.hpp>

#include "core/base/utf8.h"

namespace glasswing {
namespace {

constexpr size_t kMaxWarnings = 50;

}  // namespace

void note_warnings(const v1::MatteMetadata& metadata, std::vector<std::string>& warnings) {
  for (const std::string& warning : metadata.warnings()) {
    if (warnings.size() < kMaxWarnings && std::ranges::find(warnings, warning) == warnings.end())
      warnings.push_back(warning);
  }
}

std::vector<std::string> warnings_of(const v1::MatteMetadata& metadata) {
  std::vector<std::string> warnings;
  note_warnings(metadata, warnings);
  return warnings;
}

void print_warnings(const std::vector<std::string>& warnings) {
  for (const std::string& warning : warnings) std::cerr << fmt::format("warning: {}\n", printable(warning));
}

void print_flagged(const PixelCount& count) {
  if (const std::string text = flagged_text(count); !text.empty()) std::cout << text << "\n";
}

void add_notes(const std::vector<std::string>& warnings, const PixelCount& count,
               nlohmann::ordered_json& written) {
  written["warnings"] = warnings;
  nlohmann::ordered_json flagged = nlohmann::ordered_json::object();
  for (size_t i = 0; i < kNamedFlags.size(); ++i) {
    if (count.worst[i] > 0) flagged[kNamedFlags[i].name] = count.worst[i];
  }
  written["object_pixels"] = count.object;
  written["flagged"] = std::move(flagged);
}

}  // namespace glasswing
