// Sessions that belong together.
#pragma once

#include <string>

#include "glasswing/v1/session.pb.h"

namespace glasswing {

// The session's name without the numbers at its end: "vase" of "vase-7", "vase-090.5" and
// "vase-20261101-203000". A name that is nothing else is a series of its own.
std::string series_of(const std::string& session);
// Of a view: the series of its session, with the camera.
std::string series_of(const v1::Session& session);

}  // namespace glasswing
