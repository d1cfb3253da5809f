// A session with several cameras is made of views: sessions of one camera each, captured together. Only views
// are stored; the session is their sum.
#pragma once

#include <absl/status/status.h>

#include <string>
#include <vector>

#include "glasswing/v1/session.pb.h"

namespace glasswing {

// "vase.left"
std::string view_name(const std::string& session, const std::string& camera);

// The plan of each view, or the plan itself if it is of one camera.
std::vector<v1::Plan> view_plans(const v1::Plan& plan);

// The name that people gave: of a view that of its session.
const std::string& capture_name(const v1::Session& session);

// The session of these views, with its allowed actions. There must be one at least.
v1::Session sum_of(const std::vector<v1::Session>& views);

// FAILED_PRECONDITION names the views, for a call that needs one of them.
absl::Status choose_view(const v1::Session& sum);

}  // namespace glasswing
