#include "compositing/view/matte_notes.h"

#include <fmt/format.h>

#include <iostream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "core/base/utf8.h"

namespace glasswing {

void print_warnings(const v1::MatteMetadata& metadata) {
  for (const std::string& warning : metadata.warnings())
    std::cerr << fmt::format("warning: {}\n", printable(warning));
}

void print_flagged(const PixelCount& count) {
  if (const std::string text = flagged_text(count); !text.empty()) std::cout << text << "\n";
}

void add_notes(const v1::MatteMetadata& metadata, const PixelCount& count, nlohmann::ordered_json& written) {
  written["warnings"] = std::vector<std::string>(metadata.warnings().begin(), metadata.warnings().end());
  nlohmann::ordered_json flagged = nlohmann::ordered_json::object();
  for (size_t i = 0; i < kNamedFlags.size(); ++i) {
    if (count.worst[i] > 0) flagged[kNamedFlags[i].name] = count.worst[i];
  }
  written["object_pixels"] = count.object;
  written["flagged"] = std::move(flagged);
}

}  // namespace glasswing
