#include "server/mattes/stored_matte.h"

#include <fmt/format.h>

#include <algorithm>

#include "core/base/checksum.h"
#include "core/base/status.h"
#include "server/mattes/verified_mattes.h"

namespace glasswing {

absl::Status StoredMatte::send(absl::FunctionRef<bool(std::string_view chunk)> take) const {
  RunningChecksum checksum;
  checksum.start();
  bool taken = true;
  GW_RETURN_IF_ERROR(for_chunks(file_, [&](std::string_view chunk) {
    checksum.add(chunk);
    return taken = take(chunk);
  }));
  if (!taken || checksum_.empty() || checksum.text() == checksum_) return absl::OkStatus();
  return absl::DataLossError(fmt::format("{} was altered while it was sent", file_.path().string()));
}

}  // namespace glasswing
