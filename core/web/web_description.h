// What a player reads beside a web matte's planes (docs/web.md): matte.json of a folder for the web, and of
// the console's answers.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "core/web/web_matte.h"
#include "glasswing/v1/matte.pb.h"

namespace glasswing {

// `metadata`: of the matte that was encoded. Of `sampling_px` x `sampling_px` pixels of the camera one is in
// it.
nlohmann::ordered_json describe_web_matte(const std::string& title, const v1::MatteMetadata& metadata,
                                          int sampling_px, const WebMatte& web);

}  // namespace glasswing
