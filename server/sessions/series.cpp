#include "server/sessions/series.h"

namespace glasswing {

std::string series_of(const std::string& session) {
  constexpr char kDigits[] = "0123456789", kNumbers[] = "0123456789.-_";
  const bool numbered = session.find_last_of(kDigits) + 1 == session.size();
  const std::string::size_type last = session.find_last_not_of(kNumbers);
  return numbered && last != std::string::npos ? session.substr(0, last + 1) : session;
}

}  // namespace glasswing
