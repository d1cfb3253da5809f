#include "server/sessions/series.h"

#include "server/sessions/views.h"

namespace glasswing {

std::string series_of(const std::string& session) {
  constexpr char kDigits[] = "0123456789", kNumbers[] = "0123456789.-_";
  const bool numbered = session.find_last_of(kDigits) + 1 == session.size();
  const std::string::size_type last = session.find_last_not_of(kNumbers);
  return numbered && last != std::string::npos ? session.substr(0, last + 1) : session;
}

std::string series_of(const v1::Session& session) {
  if (session.view_of().empty()) return series_of(session.name());
  return view_name(series_of(session.view_of()), session.view_camera());
}

}  // namespace glasswing
