#include "display-node/backend_table.h"

#include "display-node/backends/kms_backend.h"
#include "display-node/backends/sim_backend.h"
#include "display-node/backends/x11_backend.h"

namespace glasswing {

std::vector<DisplayBackend> display_backends() {
  return {sim_display_backend(), x11_display_backend(), kms_display_backend()};
}

}  // namespace glasswing
